"""Memory does not grow with the length of a log."""

import tracemalloc

import numpy as np
import pytest

from identifiability import Log, Model, Regression, gather_information, prepare_log
from identifiability.estimation.estimate import Outliers
from identifiability.estimation.prediction import predict
from identifiability.foundation.engines import Serial
from identifiability.quality.hints import leave_out_rows

from ..marks import everything


def peak(robot, path):
    """The largest memory [bytes] from the file to the prediction errors."""
    model = Model.of("rigid_body", "viscous_friction")
    tracemalloc.start()
    samples = prepare_log(robot, Log.read(path), engine=Serial())
    regression = Regression(robot, model, (samples,), np.array([3, 6, 10, 11]))
    gather_information(regression, blocks=16)
    predict(regression, np.zeros((4, 2)))
    at = np.zeros(40, int)
    leave_out_rows((samples,), Outliers(at, at, at + 5, at, at, at))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


# Text is read in larger pieces than Parquet, and fills them later.
@pytest.mark.parametrize(
    "form, samples",
    [("parquet", 8_000), everything("csv", 48_000)],
)
def test_three_times_the_samples_take_the_same_memory(
    form, samples, sizes, few_windows, frame_of, saved, monkeypatch, two_link
):
    from identifiability.regression import regression as model

    sizes(piece=500, shortest=2000, rows=500, characters=50_000)
    few_windows(250)
    monkeypatch.setattr(model, "KEEP_BYTES", 0)
    frame = frame_of("two-link", periods=8, samples=500, derivatives=False)
    step = frame["t"][1] - frame["t"][0]
    _, short, long = (  # the first one imports what reads the form
        peak(two_link, saved(frame.iloc[np.arange(n) % 4000].assign(t=step * np.arange(n)), form))
        for n in (4_000, samples, 3 * samples)
    )
    assert long < 1.35 * short  # of a megabyte
