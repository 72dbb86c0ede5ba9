"""What the runs of the benchmark say: do answers agree, and is what was asked for reached?"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.report import Check
from peers.running import Measured

FITS = ("ours", "bare loop", "FIGAROH", "FIGAROH, pivoting")
PHYSICAL = ("ours, physical", "FIGAROH, physical", "cvxpy, all rows")

#: What is asked: times faster than FIGAROH, MB, and times faster to a real robot.
FASTER, MEGABYTES, PHYSICAL_FASTER = 8.0, 300.0, 50.0

#: Largest relative difference of answers that are called the same.
SAME, SAME_PHYSICAL = 1e-8, 1e-6


def find(runs: Sequence[Measured], name: str, samples: int) -> Measured | None:
    """Return a run that there is a result of."""
    return next((r for r in runs if r.ran and (r.name, r.samples) == (name, samples)), None)


def difference(a: Any, b: Any) -> float:
    """Return the largest difference, relative to the largest value."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return float(np.abs(a - b).max() / np.abs(b).max())


def agreement(runs: Sequence[Measured]) -> pd.DataFrame:
    """Return the largest differences between every contender's answer and ours, by samples."""
    rows = []
    for r in runs:
        ours = find(runs, "ours, physical" if r.name in PHYSICAL else "ours", r.samples)
        if not r.ran or ours is None or r is ours:
            continue
        row: dict[str, Any] = {"contender": r.name, "samples": r.samples}
        mine, theirs = ours.evidence, r.evidence
        if r.name in PHYSICAL:
            gap = difference(theirs["rss"], mine["rss"])
            row["residual sum of squares"] = checked(gap, SAME_PHYSICAL)
        else:
            row["regressor"] = checked(difference(theirs["regressor"], mine["regressor"]), SAME)
            if "torque" in theirs:
                row["rank"] = Check(
                    str(theirs["rank"]), theirs["rank"] == mine["rank"], f"ours {mine['rank']}"
                )
                for key, title in (("torque", "torque"), ("torque_sd", "σ of the torque")):
                    row[title] = checked(difference(theirs[key], mine[key]), SAME)
                gap = difference(theirs["variance"], mine["variance"])
                row["noise variance"] = checked(gap, SAME)
        rows.append(row)
    return pd.DataFrame(rows)


def checked(gap: float, most: float) -> Check:
    """Return a relative difference beside its bound."""
    return Check(f"{gap:.1e}", gap <= most, f"at most {most:.0e}")


def all_agree(frame: pd.DataFrame) -> bool:
    """Return whether no answer differs."""
    cells = [c for c in frame.to_numpy().ravel() if isinstance(c, Check)]
    return all(c.passed for c in cells)


def after_regressor(run: Measured) -> float:
    """Return the processor time of a physical fit without its regressor [s].

    Ours compresses while it makes the regressor; that is counted in full.
    """
    spent = {k: v[0] for k, v in run.phases.items()}
    return run.seconds if run.name.startswith("ours") else run.seconds - spent["regressor"]


def targets(runs: Sequence[Measured], at: int) -> pd.DataFrame:
    """Return what is asked for beside what was measured."""
    rows = []

    def add(what: str, value: float, text: str, passed: bool, asked: str) -> None:
        rows.append({"what": what, "measured": Check(text, passed, asked)})

    ours, bare = find(runs, "ours", at), find(runs, "bare loop", at)
    for name in ("FIGAROH, pivoting", "FIGAROH"):
        other = find(runs, name, at)
        if ours and other:
            ratio = other.seconds / ours.seconds
            what = f"base parameters and σ, times faster than {name}"
            add(what, ratio, f"{ratio:.1f} ×", ratio >= FASTER, f"at least {FASTER:g} ×")
    if ours:
        text = f"{ours.peak:.0f} MB"
        add("memory at most", ours.peak, text, ours.peak <= MEGABYTES, f"at most {MEGABYTES:g} MB")
    mine = find(runs, "ours, physical", at)
    for name in ("FIGAROH, physical", "cvxpy, all rows"):
        other = find(runs, name, at)
        if mine and other:
            ratio = after_regressor(other) / mine.phases["semidefinite program"][0]
            what = f"semidefinite program, times faster than {name} with its compression"
            add(what, ratio, f"{ratio:.0f} ×", ratio >= PHYSICAL_FASTER,
                f"at least {PHYSICAL_FASTER:g} ×")  # fmt: skip
    if ours and bare:
        ratio = ours.phases["regressor"][0] / bare.seconds
        rows.append({
            "what": "regressor with its compression, over the bare loop",
            "measured": f"{ratio:.2f} ×",
        })  # fmt: skip
    return pd.DataFrame(rows)


def reason(runs: Sequence[Measured], name: str, samples: int) -> str:
    """Return why a contender has no result."""
    why = [r.why for r in runs if (r.name, r.samples) == (name, samples)]
    return (why or ["it was not asked for"])[0]


def versions() -> dict[str, str]:
    """Return the versions that were measured."""
    out = {"python": platform.python_version(), "machine": processor()}
    for package in ("identifiability", "figaroh", "pin", "numpy", "scipy", "cvxpy", "clarabel",
                    "picos", "cvxopt"):  # fmt: skip
        try:
            out[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            out[package] = "not installed"
    return out


def processor() -> str:
    """Return what the machine says of its processor."""
    path = Path("/proc/cpuinfo")
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    names = [line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.processor() or platform.machine()


def time_table(runs: Sequence[Measured], names: Sequence[str]) -> pd.DataFrame:
    """Return time and memory of every run, or why there is none."""
    rows = []
    for r in (r for name in names for r in runs if r.name == name):
        row: dict[str, Any] = {"contender": r.name, "samples": r.samples}
        if r.ran:
            row |= {
                "processor [s]": f"{r.seconds:.3g}",
                "µs a sample": f"{1e6 * r.seconds / r.samples:.3g}",
                "wall [s]": f"{sum(p[1] for p in r.phases.values()):.3g}",
                "memory [MB]": round(r.peak),
                "of it imports [MB]": round(r.imports),
            }
        rows.append(row | {"not run, because": r.why})
    frame = pd.DataFrame(rows).fillna("")
    return frame if frame["not run, because"].any() else frame.drop(columns="not run, because")
