"""What several sections derive from an analysis."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.numbers import format_number, format_percent
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult


def unseen_samples(analysis: Analysis) -> tuple[Prepared, ...]:
    """Return the logs that held-out predictions are made on."""
    return analysis.validation or analysis.samples


def torque_units(robot: Robot) -> tuple[str, ...]:
    """Return N or N·m for each actuated joint."""
    return tuple("N" if robot.is_prismatic(int(k)) else "N·m" for k in robot.actuated)


def velocity_units(robot: Robot) -> tuple[str, ...]:
    """Return m/s or rad/s for each actuated joint."""
    return tuple("m/s" if robot.is_prismatic(int(k)) else "rad/s" for k in robot.actuated)


def model_title(result: RungResult) -> str:
    """Return the name of a model as it stands in a sentence."""
    return result.name if "model" in result.name.lower() else f"“{result.name}”"


def error_text(error: float) -> str:
    """Return an error, given as a fraction, in percent to three digits."""
    return f"{format_number(100 * error, 3, pad=True)} %" if np.isfinite(error) else "—"


def sigma_inflation(result: RungResult) -> float:
    """Return by how much autocorrelation widens σ, over the determined parameters."""
    pairs = [(v.sigma_robust, v.sigma) for v in result.verdicts]
    ratios = [a / b for a, b in pairs if 0 < b < np.inf and np.isfinite(a)]
    return float(np.median(ratios)) if ratios else 1.0


def stated_values(analysis: Analysis, result: RungResult) -> list[float | None]:
    """Return what the robot file states for each parameter, None where it states nothing."""
    known, base = analysis.robot.nominal, analysis.base
    stated = np.array([any(p.name in known for _, p in base.terms(r)) for r in range(len(base))])
    member = np.abs(result.rung.M) > 0
    return [
        v.nominal if v.nominal is not None and stated[member[:, k]].any() else None
        for k, v in enumerate(result.verdicts)
    ]


def percents(result: RungResult) -> tuple[Array, Array]:
    """Return σ% white and robust of each parameter, infinite where it is not determined."""
    white = np.array([v.sigma_percent for v in result.verdicts], float)
    robust = np.array([v.sigma_robust_percent for v in result.verdicts], float)
    unknown = ~np.array(result.estimate.determined, bool)
    return np.where(unknown, np.inf, white), np.where(unknown, np.inf, robust)


def stated_text(stated: float | None) -> str:
    """Return a stated value; sums that cancel leave a rounding error, which is zero."""
    return "0" if stated is not None and abs(stated) < 1e-12 else format_number(stated)


def time_text(time: float) -> str:
    """Return an autocorrelation time in samples."""
    return f"{time:.2f}" if time < 10 else f"{time:.0f}"


def percent_text(value: float) -> str:
    """Return a percentage with its sign, or a dash."""
    text = format_percent(value)
    return f"{text} %" if text != "—" else text
