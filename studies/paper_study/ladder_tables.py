"""Tables 3 to 6 have one form: errors and counts of Models 1 to 4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from identifiability.foundation.rounding import format_measured, format_number
from identifiability.report import Cell, check_cell
from paper_study.monte_carlo import Case, Trial, stack
from paper_study.result import StudyTable, compare

MODELS = ("Model 1", "Model 2", "Model 3", "Model 4")

#: How far outside the range of our trials a printed number may be [points]: the paper's single draw
#: has an unknown trajectory and number of samples, over which our means differ by about as much.
FLOOR_RA, FLOOR_AV = 0.3, 0.5

Trials = Mapping[Case, Sequence[Trial]]


def percent(trials: Sequence[Trial], name: str) -> np.ndarray:
    """Return an error of all trials in percent, (trials, m)."""
    return 100 * stack(trials, name)


def pool(trials: Trials, samples: int) -> list[Trial]:
    """Return the trials of all trajectories with some number of samples."""
    return [t for case, some in trials.items() if case.samples == samples for t in some]


def means(trials: Trials, name: str, scale: float = 100.0) -> np.ndarray:
    """Return the mean of an attribute in each case, (cases, m)."""
    return np.array([scale * stack(t, name).mean(0) for t in trials.values()])


def beside_paper(
    trials: Trials,
    printed: Mapping[str, Mapping[str, Any]],
    reasons: Mapping[str, str],
    caption: str,
    sizes: Sequence[int] = (750, 100),
) -> list[StudyTable]:
    """Return the table of the paper and ours side by side, pooled over trajectories.

    Parameters
    ----------
    trials : mapping
        Case → trials.
    printed : mapping
        Model → printed row.
    reasons : mapping
        ``error_ra``, ``error_av``, ``identified`` → why ours differs where it does; with a model's
        name behind it, for that model alone.
    caption : str
    sizes : sequence of int
        Numbers of samples.

    Returns
    -------
    list of StudyTable
        One for each printed column: ε_RA, ε_AV, number of parameters.
    """
    pooled = {n: pool(trials, n) for n in sizes}
    floors = {"error_ra": FLOOR_RA, "error_av": FLOOR_AV}
    signs = {"error_ra": "ε_RA", "error_av": "ε_AV"}
    out = []
    for name, floor in floors.items():
        rows = []
        for m, model in enumerate(MODELS):
            wanted = printed[model][name]
            row: dict[str, Any] = {"model": model, "paper [%]": wanted}
            for n, some in pooled.items():
                reason = reasons.get(f"{name} {model}", reasons[name])
                cell = compare(percent(some, name)[:, m], wanted, floor, reason)
                row[f"ours, {n} samples [%]"] = cell
            rows.append(row)
        out.append(StudyTable(f"{signs[name]}. {caption}", pd.DataFrame(rows)))
    rows = []
    for m, model in enumerate(MODELS):
        wanted = printed[model]
        row = {"model": model, "paper": f"{wanted['parameters']} / {wanted['identified']}"}
        for n, some in pooled.items():
            row[f"ours, {n} samples"] = _counts(some, m, wanted, reasons)
        rows.append(row)
    caption = "Parameters / properly identified, smallest … largest of all trials"
    return [*out, StudyTable(caption, pd.DataFrame(rows))]


def _counts(
    trials: Sequence[Trial], m: int, wanted: Mapping[str, Any], reasons: Mapping[str, str]
) -> Cell:
    counts = stack(trials, "identified")[:, m].astype(int)
    size = int(trials[0].sizes[m])
    text = f"{size} / {span(counts)}"
    inside = counts.min() <= wanted["identified"] <= counts.max()
    if inside and size == wanted["parameters"]:
        return check_cell(text, passed=True, reason="the printed count is in our range")
    return check_cell(text, passed=False, reason=f"differs, because {reasons['identified']}")


def span(values: np.ndarray) -> str:
    """Return ``3 … 5``, or ``12`` if all are alike."""
    low, high = int(values.min()), int(values.max())
    return str(low) if low == high else f"{low} … {high}"


def by_trajectory(trials: Trials, caption: str) -> StudyTable:
    """Return one row a trajectory, number of samples and model."""
    rows = []
    for case, some in trials.items():
        for m, model in enumerate(MODELS):
            ra, av = percent(some, "error_ra")[:, m], percent(some, "error_av")[:, m]
            counts = stack(some, "identified")[:, m]
            rows.append(
                {
                    "model": model,
                    "trajectory": case.trajectory,
                    "samples": case.samples,
                    "ε_RA [%]": spread(ra),
                    "ε_AV [%]": spread(av[np.isfinite(av)]),
                    "identified": f"{span(counts)} of {int(some[0].sizes[m])}",
                    "possible [%]": round(100 * float(stack(some, "feasible")[:, m].mean()), 1),
                }
            )
    frame = pd.DataFrame(rows).sort_values(["model", "samples", "trajectory"], kind="stable")
    return StudyTable(caption, frame)


def spread(x: np.ndarray) -> str:
    """Return mean ± standard deviation."""
    if not len(x):
        return "—"
    if len(x) == 1:
        return format_number(float(x[0]), 4)
    return " ± ".join(format_measured(float(x.mean()), float(x.std())))


def trial_records(trials: Trials) -> list[dict[str, Any]]:
    """Return means and standard deviations for the JSON file."""
    out = []
    for case, some in trials.items():
        row: dict[str, Any] = {k: v for k, v in vars(case).items() if k != "robot" and v != ""}
        row["seeds"] = len(some)
        row["dropped_samples"] = sum(t.dropped for t in some)
        for name in ("error_ra", "error_exact", "error_av", "identified", "feasible"):
            x = stack(some, name)
            row[name] = {"mean": x.mean(0).tolist(), "sd": x.std(0).tolist()}
        out.append(row)
    return out
