"""Criteria of an exciting motion, on Gram matrices ``WᵀW``, for a `Question`.

A question lists the columns that a motion should separate. `Known` holds the information of earlier
logs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from identifiability.effects import Effect, Part, Placed, find_effect
from identifiability.estimation.estimate import estimate
from identifiability.foundation.errors import IdentifiabilityError, ModelError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array, Strings, find_named
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.information import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import BaseParameters, Structure
from identifiability.robot import Robot
from identifiability.workflows.provenance import given_paths

# Criteria of an exciting motion, on Gram matrices ``WᵀW``.
#
# What to use when: `LogDet` for a first log or the next one, about some parameters with all others
# unknown [Swevers 1997] (D_s-optimality, [Atkinson 2007, sec. 10.3]), or to separate two effects.
# `Discrimination` separates effects of known size from rivals or from the model. Each gives a cost
# to minimise, batched over candidates, and its figure for readers.


@frozen
class LogDet:
    """Log-determinant of the information about some parameters, all others unknown.

    Attributes
    ----------
    chosen : (c,) int
        Columns.
    name : {"information", "separate"}
        Whether it is about parameters, or about the columns of two effects.
    """

    chosen: np.ndarray
    name: str = "information"
    title = "log-det of the information"

    def cost(self, G: Array) -> Array:
        """Return the mean logarithm of σ along the principal axes: −log-det / 2c."""
        unit, length = scaled(G)
        c = self.chosen
        others = np.setdiff1d(np.arange(G.shape[1]), c)
        gain = _log_det(unit) - _log_det(unit[:, others][:, :, others])
        log_lengths = np.log(length[:, c])
        gain = gain + 2 * log_lengths.sum(1)
        return -gain / (2 * len(c))

    def figure(self, cost: float) -> float:
        """Return the log-determinant."""
        return float(-2 * len(self.chosen) * cost)


@frozen
class Ask:
    """A true effect of known size, and the rival that it may be confused with.

    Attributes
    ----------
    own : (p,) int
        Columns of the true effect.
    values : (p,)
        Its size.
    others : tuple of (q,) int
        Columns of a rival with each of its shapes, of which the most alike counts; one without
        columns if the effect is separated from the model alone.
    """

    own: np.ndarray
    values: Array
    others: tuple[np.ndarray, ...]


@frozen
class Discrimination:
    """The part of true effects of known size that neither the model nor a rival explains.

    T-optimality [Atkinson & Fedorov 1975]: half of these squares, the non-centrality, is the
    expected logarithm of the likelihood ratio. Gram matrices are in units of the noise. The
    criterion is the harmonic mean over `asks`, so that separated effects weigh little. The first
    `model` columns are the model.
    """

    model: int
    asks: tuple[Ask, ...]
    name = "discriminate"
    title = "torque that only the true effect explains, in standard deviations"

    def cost(self, G: Array) -> Array:
        """Return half the logarithm of the mean of one over one more than the squares, (m,)."""
        left = 1.0 / (1.0 + self.squares(G))
        return 0.5 * np.log(np.mean(left, axis=0))

    def figure(self, cost: float) -> float:
        """Return the root of these squares."""
        return float(np.sqrt(max(np.exp(-2 * cost) - 1.0, 0.0)))

    def squares(self, G: Array) -> Array:
        """Return the non-centrality of each ask, (asks, m)."""
        unit, length = scaled(G)
        squares = []
        for ask in self.asks:
            outside = [self._outside(unit, length, ask, other) for other in ask.others]
            squares.append(np.min(outside, axis=0))
        return np.array(squares)

    def _outside(self, unit: Array, length: Array, ask: Ask, other: np.ndarray) -> Array:
        """Return the squares of an effect outside of the model and other columns, (m,)."""
        size = length[:, ask.own] * ask.values
        rest = np.append(np.arange(self.model), other)
        S = unit[:, ask.own][:, :, ask.own]
        base = unit[:, rest][:, :, rest]
        cross = unit[:, rest][:, :, ask.own]
        steady = base + TINY * np.eye(len(rest))
        S = S - cross.transpose(0, 2, 1) @ np.linalg.solve(steady, cross)
        return np.maximum(np.einsum("mi,mij,mj->m", size, S, size), 0.0)


#: A figure of merit of Gram matrices (m, k, k): its `cost` (m,) is minimised, its `figure` states a
#: cost for readers.
Criterion: TypeAlias = LogDet | Discrimination


def scaled(G: Array) -> tuple[Array, Array]:
    """Return Gram matrices of columns of length one, and the lengths (m, k).

    Columns that never act are zero, with length one.
    """
    length = np.sqrt(np.maximum(np.diagonal(G, axis1=1, axis2=2), 0.0))
    acts = length > TINY * length.max(1, keepdims=True, initial=0.0)
    safe = np.where(acts, length, 1.0)
    unit = np.where(acts[:, :, None] & acts[:, None, :], G, 0.0)
    return unit / (safe[:, :, None] * safe[:, None, :]), safe


def _log_det(G: Array) -> Array:
    """Return log-determinants of scaled Gram matrices (m, k, k); 0 × 0 ones have 0."""
    steady = G + TINY * np.eye(G.shape[1])
    return np.linalg.slogdet(steady)[1]


# `Question`: columns that a motion should separate, and earlier information on them.


@frozen
class Question:
    """Columns of a model, and the criterion.

    Attributes
    ----------
    structure : Structure
        The robot under the model.
    model : Model
        With the effects to separate, if any, at its end.
    columns : (k,) int
        Of the model: base parameters, then the columns of these effects.
    names, units : tuple of str
        Of the k columns.
    chosen : tuple of str
        Parameters, or the effects, that the criterion is about; empty for all.
    criterion : Criterion
    """

    structure: Structure
    model: Model
    columns: np.ndarray
    names: Strings
    units: Strings
    chosen: Strings
    criterion: Criterion

    def along(self, samples: Sequence[Dataset]) -> Regression:
        """Return the columns along prepared logs."""
        return Regression(self.structure.robot, self.model, tuple(samples), self.columns)


@frozen
class Known:
    """Information of earlier logs.

    Attributes
    ----------
    G : (k, k)
        Gram matrix of all logs, actuators weighted; zero without logs.
    weights : (n,)
        Inverse of the variance of each actuator's noise times its autocorrelation time; ones
        without logs.
    samples : float
        Mean number of one log; the next log is assumed to have as many.
    values : (k,)
        Estimates from all logs. Without logs they are those of the robot file, or zero.
    logs : tuple of str
    """

    G: Array
    weights: Array
    samples: float
    values: Array
    logs: Strings = ()

    @property
    def repeated(self) -> Array:
        """Gram matrix if the logs' motion were measured once more, (k, k)."""
        return self.G * (1 + 1 / max(len(self.logs), 1))


def pose_question(
    structure: Structure, parameters: Sequence[str] | None, separate: Sequence[str] | None
) -> Question:
    """Return the question that the arguments of `excite` ask of a robot under a model.

    Raises
    ------
    ModelError, IdentifiabilityError
    """
    if separate is not None and (len(separate) != 2 or parameters):
        raise IdentifiabilityError(Finding("excite.pair", count=len(separate)))
    robot = structure.robot
    question = add_beside(structure, [_place_effect(robot, text) for text in separate or ()])
    if separate is not None:
        k = len(question.columns)
        both = sum(question.model.widths(robot)[-2:])
        rule = LogDet(np.arange(k - both, k), "separate")
        return replace(question, chosen=tuple(separate), criterion=rule)
    at = _find_parameters(structure.base, parameters)
    chosen = tuple(question.names[k] for k in at) if parameters else ()
    return replace(question, chosen=chosen, criterion=LogDet(at))


def add_beside(structure: Structure, effects: Sequence[Effect]) -> Question:
    """Return the question of all parameters of a model, with the columns of effects at its end."""
    base = structure.base
    whole = Model((*structure.model.effects, *effects)) if effects else structure.model
    every = whole.parameters(structure.robot)
    added = range(len(base.parameters), len(every))
    taken = {every[k].name for k in added}  # the model lacks the effects to separate
    kept = (k for k in base.kept if every[k].name not in taken)
    columns = np.array([*kept, *added], int)
    names, units = (tuple(getattr(every[k], what) for k in columns) for what in ("name", "unit"))
    return Question(structure, whole, columns, names, units, (), LogDet(np.arange(len(columns))))


def know_nothing(question: Question, planned: int) -> Known:
    """Return the knowledge without logs; the next log has the planned samples."""
    k = len(question.columns)
    n = len(question.structure.robot.actuated)
    nominal = zip(question.structure.base.names, question.structure.nominal_base, strict=True)
    filed = dict(nominal)
    values = np.array([filed.get(name, 0.0) for name in question.names])
    return Known(np.zeros((k, k)), np.ones(n), float(planned), values)


def gather_known(regression: Regression) -> Known:
    """Return the information of logs on the columns of a question."""
    k = len(regression.parameters)
    samples = regression.samples
    information = gather_information(regression)
    fit = estimate(information)
    noise = fit.variance * fit.times  # that an average over many samples has
    least = TINY * float(noise.max()) or 1.0
    weights = 1.0 / np.maximum(noise, least)
    R = information.factor(weights)[:k, :k]
    planned = information.samples / len(samples)
    return Known(R.T @ R, weights, planned, fit.value, given_paths(samples))


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
    members = base.names
    found = list(members) if not names else []
    for text in names or ():
        named = find_named(text, members)
        if not named:
            raise ModelError(
                f"'{text}' is no base parameter{near_match(text, members)} "
                f"The base parameters are {listing(members, things='parameters')}."
            )
        found += named
    return np.array([members.index(name) for name in dict.fromkeys(found)], int)
