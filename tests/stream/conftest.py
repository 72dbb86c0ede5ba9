"""Long logs in small: pieces, windows and stretches are made short, so that there are many."""

import numpy as np
import pandas as pd
import pytest

from identifiability import Noise
from identifiability.logs import rows as rows_of
from identifiability.logs import tables
from identifiability.logs.prepare import dataset
from identifiability.regression import regression as windows

from ..conftest import simulated_log


@pytest.fixture
def sizes(monkeypatch):
    """A function that makes logs long from some hundred rows on, and sets how long pieces are."""

    def chosen(piece=700, shortest=1500, rows=400, characters=30_000):
        monkeypatch.setattr(rows_of, "LONG", 0)
        monkeypatch.setattr(rows_of.divide_rows, "__defaults__", (shortest,))
        monkeypatch.setattr(dataset, "WINDOW", piece)
        monkeypatch.setattr(dataset, "MARGINS", 0)
        monkeypatch.setattr(tables, "PIECE_CELLS", 10 * rows)
        monkeypatch.setattr(tables, "PIECE_LETTERS", characters)

    return chosen


@pytest.fixture
def few_windows(monkeypatch):
    """A function that sets how long windows are on which logs are decided upon."""

    def chosen(window):
        monkeypatch.setattr(rows_of, "WINDOW", window)
        monkeypatch.setattr(windows, "EXCERPT", 10 * window)
        monkeypatch.setattr(windows, "WINDOWS", 10)
        monkeypatch.setattr(windows, "WINDOW", window)

    return chosen


@pytest.fixture
def frame_of():
    """A function (robot, periods, samples) -> table of a trajectory repeated with fresh noise."""

    def made(name, periods=5, samples=1000, *, derivatives=True):
        trajectory = "601" if name == "3-rps" else "a"
        clean = simulated_log(name, trajectory, noise=Noise(), samples=samples).to_frame()
        frame = pd.concat([clean] * periods, ignore_index=True)
        frame["t"] = np.median(np.diff(clean["t"])) * np.arange(len(frame))
        rng = np.random.default_rng(0)
        for column in frame:
            if column.endswith(".tau"):
                size = 0.05 * frame[column].std()
                frame[column] += size * rng.standard_normal(len(frame))
        if derivatives:
            return frame
        return frame[[c for c in frame if not c.endswith(("dq", "ddq"))]]

    return made


@pytest.fixture
def saved(tmp_path):
    """A function (frame, form) -> path."""

    def written(frame, form="parquet", name="long"):
        path = tmp_path / f"{name}.{form}"
        if form == "parquet":
            frame.to_parquet(path, index=False, row_group_size=1300)
        else:
            frame.to_csv(path, index=False)
        return path

    return written
