"""`Question`: which columns a motion should tell apart, and what logs say of them already."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects import Effect, Part, Placed, default_effects, find_effect
from identifiability.estimation.estimate import estimate
from identifiability.foundation.errors import IdentifiabilityError, ModelError, listing, near_match
from identifiability.foundation.names import Array, find_named
from identifiability.foundation.options import check_choice
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.base_parameters import BaseParameters
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import USUAL_EFFECTS, ModelLike, choose_model
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.excite.criteria import Condition, Criterion, LogDet, Separation

#: Effects of the model: for conditioning those of the literature, else those of a diagnosis.
EFFECTS = {
    "condition": ("rigid_body",),
    "information": USUAL_EFFECTS,
    "separate": USUAL_EFFECTS,
}


@frozen
class Question:
    """Columns of a model, and the criterion.

    Attributes
    ----------
    structure : Structure
        The robot under the model.
    model : Model
        With the effects that are to be separated, if any, at its end.
    columns : (k,) int
        Of the model: base parameters, then the columns of both effects.
    names, units : tuple of str
        Of the k columns.
    chosen : tuple of str
        Parameters, or the two effects, that the criterion is about; empty for all.
    criterion : Criterion
    """

    structure: Structure
    model: Model
    columns: np.ndarray
    names: tuple[str, ...]
    units: tuple[str, ...]
    chosen: tuple[str, ...]
    criterion: Criterion


@frozen
class Known:
    """What logs say already.

    Attributes
    ----------
    G : (k, k)
        Gram matrix of all logs, actuators weighted; zero without logs.
    weights : (n,)
        One over the residual variance of each actuator; ones without logs.
    samples : float
        Of one log, on average; the next one counts as many.
    logs : tuple of str
    """

    G: Array
    weights: Array
    samples: float
    logs: tuple[str, ...] = ()

    @property
    def repeated(self) -> Array:
        """Gram matrix if the logs' motion were measured once more, (k, k)."""
        again: Array = self.G * (1 + 1 / max(len(self.logs), 1))
        return again


def pose_question(
    robot: Robot,
    criterion: str,
    model: ModelLike | None,
    parameters: Sequence[str] | None,
    separate: Sequence[str | Effect] | None,
) -> Question:
    """Return the question that the arguments of `excite` ask.

    Raises
    ------
    ModelError, IdentifiabilityError
    """
    check_choice("criterion", criterion, tuple(EFFECTS))
    _check_fit(criterion, parameters, separate)
    pair = [e if isinstance(e, Effect) else _place_effect(robot, e) for e in separate or ()]
    own = EFFECTS[criterion]
    usual = own if criterion == "condition" else default_effects(robot, own)
    chosen_model = choose_model(model, usual)
    structure = Structure.of(robot, chosen_model)
    base = structure.base
    whole = Model((*chosen_model.effects, *pair))
    every = whole.parameters(robot)
    added = range(len(base.parameters), len(every))
    taken = {every[k].name for k in added}  # what is to be separated is no part of the model
    kept = [k for k in base.kept if every[k].name not in taken]
    columns = np.array([*kept, *added], int)
    names = tuple(every[k].name for k in columns)
    units = tuple(every[k].unit for k in columns)
    rule: Criterion = Condition()
    chosen = tuple(e.texts[0] if isinstance(e, Effect) else e for e in separate or ())
    if criterion == "information":
        at = _find_parameters(base, parameters)
        rule, chosen = LogDet(at), tuple(base.names[k] for k in at) if parameters else ()
    elif criterion == "separate":
        split = len(kept) + len(pair[0].parameters(robot))
        rule = Separation(np.arange(len(kept), split), np.arange(split, len(columns)))
    return Question(structure, whole, columns, names, units, chosen, rule)


def gather_known(question: Question, samples: Sequence[Prepared], planned: int) -> Known:
    """Return what logs say; without logs nothing, and the next log has the `planned` samples."""
    k, n = len(question.columns), len(question.structure.robot.actuated)
    if not samples:
        return Known(np.zeros((k, k)), np.ones(n), float(planned))
    regression = Regression(
        question.structure.robot, question.model, tuple(samples), question.columns
    )
    information = gather_information(regression)
    variance = estimate(information).variance
    weights = 1.0 / np.maximum(variance, 1e-12 * float(variance.max()) or 1.0)
    R = information.factor(weights)[:k, :k]
    names = tuple(s.name for s in samples)
    return Known(R.T @ R, weights, information.samples / len(samples), names)


def _check_fit(
    criterion: str, parameters: Sequence[str] | None, separate: Sequence[str | Effect] | None
) -> None:
    """Refuse arguments that belong to another criterion."""
    if criterion == "separate" and (separate is None or len(separate) != 2):
        raise IdentifiabilityError(
            f"To separate takes exactly two effects, {len(separate or ())} were given; name two, "
            "such as stribeck_friction and quadratic_friction@slider1."
        )
    if criterion != "separate" and separate:
        raise IdentifiabilityError(
            f"Two effects are separated by the criterion 'separate', not by '{criterion}'."
        )
    if criterion != "information" and parameters:
        raise IdentifiabilityError(
            f"Parameters are chosen for the criterion 'information', not for '{criterion}'."
        )


def _place_effect(robot: Robot, text: str) -> Effect:
    """Return the effect of ``NAME`` or, at a joint, a body or those that fit, ``NAME@PLACE``."""
    name, _, place = text.partition("@")
    effect = find_effect(name)
    owners = list(dict.fromkeys(p.owner for p in effect.parameters(robot)))
    if not owners:
        raise ModelError(f"{name} has no parameter on {robot.name}; choose another effect.")
    chosen = find_named(place or "*", owners)
    if not chosen:
        raise ModelError(
            f"{name} has no parameter at '{place}' of {robot.name}{near_match(place, owners)} "
            f"It acts at {listing(owners)}."
        )
    return Placed([Part(effect, owner) for owner in chosen])


def _find_parameters(base: BaseParameters, names: Sequence[str] | None) -> np.ndarray:
    """Return the base columns of parameters, all for None."""
    if not names:
        return np.arange(len(base))
    every = [p.name for p in base.parameters]
    found = []
    wanted = {text: find_named(text, base.names) or [text] for text in names}
    for name in dict.fromkeys(name for several in wanted.values() for name in several):
        if name not in every:
            raise ModelError(
                f"There is no parameter '{name}'{near_match(name, every)} "
                f"The base parameters are {listing(base.names)}."
            )
        if name not in base.names:
            members = [base.names[r] for r in range(len(base)) if base.G[r, every.index(name)] != 0]
            why = f"only together with {listing(members)}; choose that" if members else "by nothing"
            raise ModelError(f"No motion can determine '{name}' by itself: it acts {why}.")
        found.append(base.names.index(name))
    return np.array(found, int)
