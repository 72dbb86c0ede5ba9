"""What several sections derive from an analysis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.numbers import NONE
from identifiability.report.tables import Cell, Column, badge_cell, measured_cells
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult

if TYPE_CHECKING:
    from identifiability.workflows.prune.rung import PrunedRung


def unseen_samples(analysis: Analysis) -> tuple[Prepared, ...]:
    """Return the logs that held-out predictions are made on."""
    return analysis.validation or analysis.samples


def torque_units(robot: Robot) -> tuple[str, ...]:
    """Return N or N·m for each actuated joint."""
    return robot.torque_units


def velocity_units(robot: Robot) -> tuple[str, ...]:
    """Return m/s or rad/s for each actuated joint."""
    return tuple("m/s" if robot.is_prismatic(int(k)) else "rad/s" for k in robot.actuated)


def model_title(result: RungResult) -> str:
    """Return the name of a model as it stands in a sentence."""
    return result.name if "model" in result.name.lower() else f"“{result.name}”"


def sigma_inflation(result: RungResult) -> float:
    """Return by how much autocorrelation widens σ, over the determined parameters."""
    pairs = [(v.sigma_robust, v.sigma) for v in result.verdicts]
    ratios = [a / b for a, b in pairs if 0 < b < np.inf and np.isfinite(a)]
    return float(np.median(ratios)) if ratios else 1.0


def stated_values(analysis: Analysis, result: RungResult) -> list[float | None]:
    """Return what this fit would find on the robot of the file, None where it states nothing.

    A value that stands for more than its label is compared with what the file's robot would show.
    """
    known, base = analysis.robot.nominal, analysis.base
    stated = np.array([any(p.name in known for _, p in base.terms(r)) for r in range(len(base))])
    member = np.abs(result.rung.M) > 0
    return [
        v.projected if v.projected is not None and stated[member[:, k]].any() else None
        for k, v in enumerate(result.verdicts)
    ]


def sigma_percents(result: RungResult) -> tuple[Array, Array]:
    """Return σ white and σ for the label of each parameter [% of its value], (k,) each."""
    white = np.array([v.sigma_percent for v in result.verdicts], float)
    return white, np.array([v.sigma_label_percent for v in result.verdicts], float)


def found_cell(model: RungResult | PrunedRung) -> Cell:
    """Return how many parameters of a model are identifiable."""
    found = sum(v.verdict is Class.IDENTIFIABLE for v in model.verdicts)
    return Cell("not judged" if model.unjudged else str(found), found)


def bias_columns(verdicts: Sequence[Verdict]) -> tuple[Column, ...]:
    """Return the column of what least squares would have been, if the fit is none."""
    if all(v.bias_sigma is None for v in verdicts):
        return ()
    return (Column("least squares − value", _sigmas, "bias_sigma", detail=True),)


def _sigmas(moved: float | None) -> str:
    return NONE if moved is None else f"{moved:+z.2f} σ".replace("-", "−")


#: What every table of judged parameters shows of a `Verdict`.
VALUE = Column("value", "number", lambda v: measured_cells(v.value, v.sigma_robust)[0])
SIGMA = Column("± σ", "error", lambda v: measured_cells(v.value, v.sigma_robust)[1])
UNIT = Column("unit", get="unit")
VERDICT = Column("verdict", "badge", lambda v: badge_cell(v.verdict.value, v.reason), quiet=True)
