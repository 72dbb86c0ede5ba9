"""One spoilt or foreign log: its writer, and the expected answer of a good engineer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

#: Makes a file from a good log, in a folder.
Writer = Callable[[pd.DataFrame, Path, np.random.Generator], Path]

#: Changes a good log.
Change = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


@dataclass(frozen=True)
class Case:
    """One log.

    Attributes
    ----------
    name, family : str
    write : callable
    words : tuple of str
        What is said must hold one of these; without any the log must be read right.
    robot : str
        A shipped robot.
    sidecar : str
        Further content of its sidecar.
    columns : mapping
        As `--map` gives them.
    lock : tuple of str
        Joints that are locked, as `--lock` gives them.
    scene : callable
        Changes the text of the robot's file.
    unmeasured : tuple of str
        Joints without a torque that can be compared.
    quiet : bool
        Whether any remark is a false alarm: the log is good.
    never : bool
        It must be refused: what is left of it is not what was measured.
    """

    name: str
    family: str
    write: Writer
    words: tuple[str, ...] = ()
    robot: str = "six-dof-arm"
    sidecar: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    lock: tuple[str, ...] = ()
    scene: Callable[[str], str] | None = None
    unmeasured: tuple[str, ...] = ()
    quiet: bool = False
    never: bool = False


def csv(change: Change, **options: Any) -> Writer:
    """Return a writer of a changed log as CSV."""

    def write(frame: pd.DataFrame, folder: Path, rng: np.random.Generator) -> Path:
        path = folder / "log.csv"
        changed = change(frame, rng)
        path.write_text(changed.to_csv(**{"index": False, **options}), newline="")
        return path

    return write


def text(change: Callable[[str], str], encoding: str = "utf-8", **options: Any) -> Writer:
    """Return a writer of a CSV with changed text."""

    def write(frame: pd.DataFrame, folder: Path, _: np.random.Generator) -> Path:
        path = folder / "log.csv"
        whole = change(frame.to_csv(index=False, float_format="%.9g", **options))
        path.write_bytes(whole.encode(encoding))
        return path

    return write


def joints(frame: pd.DataFrame) -> list[str]:
    """Return the joints of a log."""
    return [c.removesuffix(".q") for c in frame.columns if c.endswith(".q")]


def scaled(frame: pd.DataFrame, kind: str, factor: Any, only: str = "") -> pd.DataFrame:
    """Return a log with the columns of a kind multiplied, of one joint or of all."""
    names = [f"{j}.{kind}" for j in joints(frame) if only in ("", j)]
    return frame.assign(
        **{n: f * frame[n] for n, f in zip(names, _each(factor, names), strict=True)}
    )


def _each(factor: Any, names: list[str]) -> list[float]:
    return list(factor) if np.ndim(factor) else [float(factor)] * len(names)
