"""Results of the benchmark: do the answers agree, and are the targets reached?"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability import __version__
from identifiability.report import Cell, check_cell
from peers.figures import times_faster
from peers.running import Measured

FITS = ("ours", "bare loop", "FIGAROH", "FIGAROH, pivoting")
PHYSICAL = ("ours, physical", "FIGAROH, physical", "cvxpy, all rows")

#: What is asked: times faster than FIGAROH, MB, and times faster to a real robot.
FASTER, MEGABYTES, PHYSICAL_FASTER = 8.0, 300.0, 50.0

#: Largest relative difference of answers that are called the same.
SAME, SAME_PHYSICAL = 1e-8, 1e-6

#: Compared quantities of an estimate, and their names.
COMPARED = {"torque": "torque", "torque_sd": "σ of the torque", "variance": "noise variance"}


def find(runs: Sequence[Measured], name: str, samples: int) -> Measured | None:
    """Return a run that there is a result of."""
    return next((r for r in runs if r.ran and (r.name, r.samples) == (name, samples)), None)


def difference(a: Any, b: Any) -> float:
    """Return the largest difference, relative to the largest value."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return float(np.abs(a - b).max() / np.abs(b).max())


def agreement(runs: Sequence[Measured]) -> pd.DataFrame:
    """Return the largest differences between every estimate and ours, by samples."""
    rows = []
    for r in runs:
        ours = find(runs, "ours", r.samples)
        if not r.ran or r.name not in FITS or ours is None or r is ours:
            continue
        mine, theirs = ours.evidence, r.evidence
        row: dict[str, Any] = {"contender": r.name, "samples": r.samples}
        row["regressor"] = checked(difference(theirs["regressor"], mine["regressor"]), SAME)
        if "torque" in theirs:
            same = theirs["rank"] == mine["rank"]
            row["rank"] = check_cell(str(theirs["rank"]), same, f"ours {mine['rank']}")
            for key, title in COMPARED.items():
                row[title] = checked(difference(theirs[key], mine[key]), SAME)
        rows.append(row)
    return pd.DataFrame(rows)


def agreement_physical(runs: Sequence[Measured]) -> pd.DataFrame:
    """Return the difference between every physical fit and ours, by samples."""
    rows = []
    for r in runs:
        ours = find(runs, "ours, physical", r.samples)
        if r.ran and r.name in PHYSICAL and ours is not None and r is not ours:
            gap = difference(r.evidence["rss"], ours.evidence["rss"])
            rows.append(
                {
                    "contender": r.name,
                    "samples": r.samples,
                    "residual sum of squares": checked(gap, SAME_PHYSICAL),
                    "its solver says": r.evidence["status"],
                }
            )
    return pd.DataFrame(rows)


def checked(gap: float, most: float) -> Cell:
    """Return a relative difference with its bound."""
    return check_cell(f"{gap:.1e}", gap <= most, f"at most {most:.0e}")


def all_agree(runs: Sequence[Measured]) -> bool:
    """Return whether no answer differs."""
    frames = agreement(runs), agreement_physical(runs)
    cells = [c for f in frames for c in f.to_numpy().ravel() if isinstance(c, Cell)]
    return all(c.badge != "differs" for c in cells)


def targets(runs: Sequence[Measured], at: int) -> pd.DataFrame:
    """Return the targets with the measured values."""
    rows = []

    def add(what: str, text: str, passed: bool | None, asked: str) -> None:
        rows.append({"what": what, "measured": check_cell(text, passed, asked)})

    def faster(what: str, ratio: float, least: float) -> None:
        add(what, f"{times_faster(ratio)} ×", ratio >= least, f"at least {least:g} ×")

    ours, bare = find(runs, "ours", at), find(runs, "bare loop", at)
    for name in ("FIGAROH, pivoting", "FIGAROH"):
        other = find(runs, name, at)
        if ours and other:
            ratio = other.seconds / ours.seconds
            faster(f"base parameters and σ, times faster than {name}", ratio, FASTER)
    if ours:
        passed = ours.peak <= MEGABYTES
        add("memory at most", f"{ours.peak:.0f} MB", passed, f"at most {MEGABYTES:g} MB")
    mine = find(runs, "ours, physical", at)
    for name in ("cvxpy, all rows", "FIGAROH, physical"):
        other = find(runs, name, at)
        if mine and other and bare:
            alone = other.spent("semidefinite program") / mine.spent("semidefinite program")
            faster(f"semidefinite program, times faster than {name}", alone, PHYSICAL_FASTER)
            ratio = (other.seconds - other.spent("regressor")) / (mine.seconds - bare.seconds)
            what = f"all after the regressor, compression included, times faster than {name}"
            add(what, f"{times_faster(ratio)} ×", None, "nothing asked")
    if ours and bare:
        ratio = ours.spent("regressor") / bare.seconds
        add("regressor with its compression, over the bare loop", f"{ratio:.2f} ×", None,
            "nothing asked")  # fmt: skip
    return pd.DataFrame(rows)


def reason(runs: Sequence[Measured], name: str, samples: int) -> str:
    """Return why a contender has no result."""
    why = [r.why for r in runs if (r.name, r.samples) == (name, samples)]
    return (why or ["it was not asked for"])[0]


def versions() -> dict[str, str]:
    """Return the versions that were measured."""
    out = {"python": platform.python_version(), "machine": processor()}
    out["identifiability"] = __version__
    for package in ("figaroh", "pin", "numpy", "scipy", "cvxpy", "clarabel",
                    "picos", "cvxopt"):  # fmt: skip
        try:
            out[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            out[package] = "not installed"
    return out


def processor() -> str:
    """Return the name of the machine's processor."""
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
