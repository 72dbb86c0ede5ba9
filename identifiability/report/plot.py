"""The figures of a report one by one, for notebooks and papers.

What to use when: `precision` for how well each parameter is known, `profile` for the 95 % region of
a number, `reduction_path` for a pruning, `torque` for measured and predicted torque. Each takes a
result and returns a Matplotlib figure, which nobody else holds: change it, or
``figure.savefig("a.pdf")``. `Result.figures` returns the figures of its page.

Example
-------
>>> from identifiability import analyze, plot  # doctest: +SKIP
>>> result = analyze("arm.urdf", "run.csv")  # doctest: +SKIP
>>> plot.precision(result).savefig("precision.pdf")  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.errors import near_match
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.options import OptionError

from .answers.prune import sizes_as_good
from .figures import draw_ladder, draw_precision, draw_profile, draw_torque

if TYPE_CHECKING:  # every report loads this module, and few need pruning or diagnosis
    from identifiability.workflows.analyze import Analysis
    from identifiability.workflows.predict import TorquePrediction
    from identifiability.workflows.prune import Ladder

__all__ = ["precision", "profile", "reduction_path", "torque"]


def precision(result: Analysis, model: str | None = None) -> Figure:
    """Draw the spread of each parameter of a model against its value, by verdict.

    Parameters
    ----------
    result : Analysis
    model : str, optional
        Name of the model; by default the one to use.
    """
    drawn = result.chosen if model is None else result.models[result.find_model(model)]
    white, known = np.array(
        [(v.sigma_percent, v.sigma_label_percent) for v in drawn.verdicts], float
    ).T
    names = [v.name for v in drawn.verdicts]
    kinds = [v.look for v in drawn.verdicts]
    limit = ESTIMATION_RULES.paper_factor * float(np.min(white, initial=np.inf))
    return draw_precision(names, white, known, kinds, Thresholds().sigma_percent, limit)


def profile(result: Analysis, name: str) -> Figure:
    """Draw the rise of the deviance as a profiled number leaves its best value.

    Parameters
    ----------
    result : Analysis
    name : str
        Of a number that `analyze` profiled.

    Raises
    ------
    OptionError
        If the number was not profiled.
    """
    curve = result.find_profile(name)
    number = curve.number
    label = f"{name} [{number.unit}]"
    ends = np.clip(curve.region, curve.grid[0], curve.grid[-1])
    return draw_profile(curve.grid, curve.rise, curve.best, ends, label, log=number.logarithmic)


def reduction_path(result: Ladder) -> Figure:
    """Draw the error of each model of a pruning against its number of parameters.

    Cross-validation chooses the model. Held-out logs judge it; without them the error of the fit
    is drawn. Models that would do as well are shaded. Errors are of the estimates; the model to
    use also has the error of the values that are exported.
    """
    held_out = bool(result.validation)
    name = "held-out logs" if held_out else "fitted stretches"
    submodels = []
    for r in result.models:
        error = r.unseen_by(0) if held_out else float(r.fitted.relative_error()[0])
        submodels.append((len(r), error, r.error_ra_unseen, r.error_se))
    sizes, other, unseen, spread = np.array(submodels).T
    exported = result.chosen.unseen_by(1)
    curves = sizes, other, unseen, spread, result.selected, name
    return draw_ladder(*curves, sizes_as_good(result), exported)


def torque(result: TorquePrediction, joint: str, log: int = 0) -> Figure:
    """Draw measured and predicted torque of a joint along a log.

    Parameters
    ----------
    result : TorquePrediction
        What `predict` of a result gives.
    joint : str
    log : int
        Which of the predicted logs.

    Raises
    ------
    OptionError
        If there is no such joint or log.
    """
    joints = list(result.robot.joints)
    if joint not in joints:
        raise OptionError(
            f"The prediction has no joint '{joint}'{near_match(joint, joints)} It has "
            f"{', '.join(joints)}."
        )
    if not 0 <= log < len(result.logs):
        raise OptionError(f"log must be from 0 to {len(result.logs) - 1}, not {log}.")
    k = joints.index(joint)
    rows = result.log == log
    measured = result.tau[rows, k]
    predicted = result.predicted[rows, k]
    title = f"{joint}, {shorten_paths(result.logs)[log]}"
    return draw_torque(
        result.t[rows],
        measured,
        predicted,
        title,
        result.robot.torque_units[k],
    )
