"""Scores of an answer: error on unseen motion, coverage, called values, names, costs."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from exam.contract import Answer, Run
from identifiability.foundation.names import Array

#: A called value is right if it misses the truth by at most this share.
RIGHT = 0.3

#: Share of a held-out log at either end that is not scored: filters have edges.
EDGE = 0.1


@dataclass(frozen=True)
class Case:
    """A case on disk.

    Attributes
    ----------
    folder : Path
    entry, truth : dict
        Content of `case.toml` and of the truth; the latter is empty where none is known.
    """

    folder: Path
    entry: dict[str, Any]
    truth: dict[str, Any] = field(default_factory=dict)

    @staticmethod
    def read(folder: Path) -> Case:
        """Read a folder."""
        entry = tomllib.loads((folder / "case.toml").read_text(encoding="utf-8"))
        name = entry["exam"].get("truth")
        truth = tomllib.loads((folder / name).read_text(encoding="utf-8")) if name else {}
        return Case(folder, entry, truth)

    @property
    def commanded(self) -> bool:
        """Whether commands drive the robot."""
        return bool(self.entry["exam"]["kind"] == "commands")

    def held_out(self) -> list[pd.DataFrame]:
        """Return the held-out logs."""
        return [pd.read_csv(self.folder / name) for name in self.entry["validate"]]


def score(case: Case, run: Run, out: Path) -> dict[str, Any]:
    """Return the scores of a run as a row of the table; NaN where there is nothing to score."""
    answer = run.answer
    row: dict[str, Any] = {"status": run.status, "why": answer.refused}
    row |= {"error [%]": float("nan")}
    if run.status == "answered":
        row["error [%]"] = 100 * unseen_error(case, answer, out)
        row |= score_values(case.truth.get("parameters", {}), answer)
        row |= score_names(case.truth, answer)
    return row | {"processor [s]": run.seconds, "memory [MB]": run.memory}


def unseen_error(case: Case, answer: Answer, out: Path) -> float:
    """Return the rms error on held-out logs over the rms of what is predicted.

    Torque is compared as it was measured; positions of commanded robots are compared about their
    mean. A tool whose predictions do not cover each log errs infinitely.
    Planted exchanges may be predicted as they are logged, or undone: the smaller error counts.
    """
    logs = case.held_out()
    pairs = case.truth.get("columns", ())
    swap = dict(pairs) | {b: a for a, b in pairs}
    return min(_error(case, answer, out, x) for x in (logs, [x.rename(columns=swap) for x in logs]))


def _error(case: Case, answer: Answer, out: Path, logs: Sequence[pd.DataFrame]) -> float:
    """Return the relative rms error on logs."""
    kind = "q" if case.commanded else "tau"
    if case.commanded and answer.robot:
        predicted = [_roll(out / answer.robot, log, answer.delay) for log in logs]
    elif len(answer.predictions) == len(logs):
        predicted = [pd.read_csv(out / name) for name in answer.predictions]
    else:
        return float("inf")
    errors, sizes = [], []
    for log, guess in zip(logs, predicted, strict=True):
        t = log["t"].to_numpy()
        edge = EDGE * (t[-1] - t[0])
        inside = (t >= t[0] + edge) & (t <= t[-1] - edge)
        columns = [c for c in log.columns if c.endswith(f".{kind}")]
        if not {"t", *columns} <= {*guess}:
            return float("inf")
        if guess["t"].iloc[0] > t[inside][0] or guess["t"].iloc[-1] < t[inside][-1]:
            return float("inf")
        for column in columns:
            measured = log[column].to_numpy()[inside]
            errors.append(measured - np.interp(t[inside], guess["t"], guess[column]))
            sizes.append(measured - measured.mean() * case.commanded)
    rms = [np.sqrt(np.mean(np.concatenate(x) ** 2)) for x in (errors, sizes)]
    return float(rms[0] / rms[1])


def _roll(path: Path, log: pd.DataFrame, delay: float) -> pd.DataFrame:
    """Return positions of a written robot that commands move in MuJoCo."""
    from so101 import roll_alone  # noqa: PLC0415 - it needs MuJoCo, which torque does not

    joints = [c.removesuffix(".cmd") for c in log.columns if c.endswith(".cmd")]
    q: Array = roll_alone(path, log, joints, delay)
    return pd.DataFrame({"t": log["t"]} | {f"{j}.q": q[:, k] for k, j in enumerate(joints)})


def score_values(truth: dict[str, float], answer: Answer) -> dict[str, float]:
    """Return coverage of stated intervals and the share of called values that are right.

    A combination with a parameter whose truth is not planted is not scored.
    """
    known = [v for v in answer.values if v.terms and truth.keys() >= v.terms.keys()]
    if not known:
        return {}
    true = [sum(c * truth[name] for name, c in v.terms.items()) for v in known]
    inside = [v.low <= x <= v.high for v, x in zip(known, true, strict=True)]
    right = [
        abs(v.value - x) <= RIGHT * abs(x) for v, x in zip(known, true, strict=True) if v.called
    ]
    out = {"intervals": len(known), "coverage": float(np.mean(inside)), "called": len(right)}
    return out | ({"called right": float(np.mean(right))} if right else {})


def score_names(truth: dict[str, Any], answer: Answer) -> dict[str, int]:
    """Return how many hidden effects and exchanged columns are named right, and wrong."""
    if not truth:
        return {}
    pairs = {tuple(sorted(p)) for p in truth.get("columns", ())}
    hidden = set(truth.get("effects", ())) | pairs
    named = set(answer.effects) | {tuple(sorted(p)) for p in answer.columns}
    return {
        "hidden": len(hidden),
        "named right": len(named & hidden),
        "named wrong": len(named - hidden),
    }
