"""Profiles of the numbers of an analysis: shapes of effects, parameters, mass and torque.

A parameter, the total mass and the torque of a joint are profiled under physical consistency. They
may be bounded although the logs determine them only together with others.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects import find_family
from identifiability.effects.effect import EXPONENT
from identifiability.effects.measurement import ClockError, FromJoint, TimeDelay
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.evidence import least_noise
from identifiability.estimation.noise import ARNoise, JointNoise
from identifiability.estimation.profile import Number, Profile, ShapeRefits, profile, profile_shape
from identifiability.foundation.errors import listing, near_match
from identifiability.foundation.linalg import NEARLY, solve_least, unit_coordinates
from identifiability.foundation.names import Array
from identifiability.foundation.options import OptionError
from identifiability.foundation.rounding import REACH
from identifiability.logs.prepare.dataset import Dataset
from identifiability.physical.fitted_model import FittedModel
from identifiability.physical.refit import refit_consistent
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure

from .result import Analysis

#: Name of the mass of all bodies, and kind of the largest torque of a joint along the fitted logs.
TOTAL_MASS, TORQUE = "total_mass", "torque"
#: Points of the first grid of a number that is no shape.
POINTS = 9
#: Factor from the value of the nearest robot to the ends of the first grid, where the logs do not
#: determine a number by themselves.
FAR = 100


def check_numbers(structure: Structure, names: Sequence[str]) -> None:
    """Refuse names of numbers that cannot be profiled.

    Raises
    ------
    OptionError
    """
    known = list_numbers(structure)
    for name in names:
        if name not in known:
            raise OptionError(
                f"There is no number '{name}' to profile{near_match(name, known)} Give a "
                f"parameter, a shape, {TOTAL_MASS} or a joint's torque: {listing(known, 8)}."
            )


def list_numbers(structure: Structure) -> list[str]:
    """Return the names of all numbers that can be profiled."""
    torques = [f"{joint}.{TORQUE}" for joint in structure.robot.joints]
    return [*list_lengths(structure), TOTAL_MASS, *torques, *structure.columns]


def list_lengths(structure: Structure) -> list[str]:
    """Return the names of shapes that are lengths or speeds, and not the number of a joint."""
    names = (name for name in structure.shapes if not name.endswith(EXPONENT))
    effects = {name: find_family(name.rpartition(".")[2]).effect for name in names}
    return [name for name, effect in effects.items() if not isinstance(effect, FromJoint)]


def profile_numbers(found: Analysis, names: Sequence[str]) -> tuple[Profile, ...]:
    """Return the profiles of some numbers, then those of the stated shapes and delays."""
    if found.nothing:
        return ()
    structure = found.structure
    columns = found.chosen.submodel.columns
    about = structure, found.samples, find_noise(found.missing.noise, found.information)
    consistent = ConsistentNumbers(found)
    usual = (*list_shapes(structure, columns), *list_delays(structure, columns))
    wanted = dict.fromkeys((*names, *usual))
    return tuple(
        profile_shape(ShapeRefits(*about, name)) if name in found.shapes else consistent.of(name)
        for name in wanted
    )


def profile_shapes(
    structure: Structure, samples: Sequence[Dataset], noise: ARNoise, columns: Sequence[str]
) -> list[Profile]:
    """Return the profiles of the shapes of a model's columns."""
    names = list_shapes(structure, columns)
    return [profile_shape(ShapeRefits(structure, samples, noise, name)) for name in names]


def list_shapes(structure: Structure, columns: Sequence[str]) -> list[str]:
    """Return the shapes that are profiled without being asked for, of a model's columns.

    The period of a ripple is left out: its best value is one of many minima, and it has no limit.
    """
    groups = {(p.owner, p.group) for p in structure.parameters if p.name in columns}
    every = (name.rpartition(".") for name in list_lengths(structure))
    return [
        f"{joint}.{family}"
        for joint, _, family in every
        if (joint, family) in groups and find_family(family).against == "velocity"
    ]


def list_delays(structure: Structure, columns: Sequence[str]) -> list[str]:
    """Return the delays and clock errors among a model's columns."""
    late = (TimeDelay.name, ClockError.name)
    return [p.name for p in structure.parameters if p.group in late and p.name in columns]


def find_noise(noise: ARNoise, information: Information) -> ARNoise:
    """Return the measured noise of each joint; without any, white noise of the residual's size."""
    if noise:
        return noise
    left = Estimator().fit(information).noise
    size = np.sqrt(np.maximum(left.variance * left.times, least_noise(information)))
    return tuple(JointNoise(np.empty(0), sigma) for sigma in size.tolist())


class ConsistentNumbers:
    """Numbers that are profiled under physical consistency: combinations of parameters.

    Parameters
    ----------
    found : Analysis
    """

    def __init__(self, found: Analysis) -> None:
        self.found = found
        self.structure = found.structure
        what = found.chosen.submodel, found.information, found.chosen.estimate
        self.model = FittedModel.recall(self.structure, *what)

    def of(self, name: str) -> Profile:
        """Return the profile of a number."""
        direction = self.direction(name)
        number = self.number(name)
        nearest = self.found.real_robot["parameters"]
        near = float(direction @ [nearest[column] for column in self.structure.columns])
        free, error, unit = self.spread(name, direction)
        if np.isfinite(error):
            lower = max(min(free, near) - 2 * REACH * error, number.least)
            upper = max(free, near) + 2 * REACH * error
            grid = np.linspace(lower, upper, POINTS)
        elif number.least == 0 and near > 0:
            number = replace(number, logarithmic=True)
            grid = near * np.geomspace(1 / FAR, FAR, POINTS)
        else:
            grid = near + np.linspace(-1.0, 1.0, POINTS) * (abs(near) or 1.0)
        return profile(number, grid, refit_consistent(self.model, direction, unit))

    def direction(self, name: str) -> Array:
        """Return a number as a combination of the standard parameters, (p,)."""
        standard = self.structure.columns
        if name in standard:
            return np.eye(len(standard))[standard.index(name)]
        if name == TOTAL_MASS:
            return np.array([float(p.kind == "m") for p in self.structure.parameters])
        return self.largest_torque(name)

    def largest_torque(self, name: str) -> Array:
        """Return the torque of a joint where it was largest, of the standard parameters, (p,)."""
        j = self.structure.robot.joints.index(name.removesuffix(f".{TORQUE}"))
        largest = 0.0
        row = np.zeros(len(self.structure.base))
        for chunk in self.structure.regression(self.found.samples).chunks():
            tau = chunk.tau[:, j]
            at = int(np.abs(tau).argmax())
            if abs(tau[at]) > largest:
                largest = float(abs(tau[at]))
                row = chunk.W[at, j] * np.sign(tau[at])
        return row @ self.structure.G

    def number(self, name: str) -> Number:
        """Return a number with its unit and its limits."""
        known = {p.name: p for p in self.structure.parameters}
        robot = self.structure.robot
        if name == TOTAL_MASS:
            return Number(name, "kg", 0.0)
        if name not in known:
            joint = robot.joints.index(name.removesuffix(f".{TORQUE}"))
            return Number(name, robot.torque_units[joint])
        return Number(name, known[name].unit, 0.0 if known[name].nonnegative else -np.inf)

    def spread(self, name: str, direction: Array) -> tuple[float, float, float]:
        """Return the estimate of a number, its standard error, and the unit of its deviance.

        With that unit [torque²] the curve has the standard error that the verdict has: it counts
        the scatter between stretches and between logs. The error is infinite where the logs alone
        do not determine the number.
        """
        chosen = self.found.chosen
        estimate = chosen.estimate
        kept = list(chosen.estimate.kept)
        loss = estimate.estimator.loss(self.model.information, estimate)
        inverse = unit_coordinates(loss[np.ix_(kept, kept)])
        roots = chosen.fit.robust[kept] / np.linalg.norm(inverse, axis=1)
        known = np.isfinite(roots)
        root = float(np.median(roots[known])) if known.any() else np.sqrt(estimate.unit)
        names = [estimate.columns[k] for k in kept]
        if name in names and known[names.index(name)]:
            root = float(roots[names.index(name)])
        x = solve_least(self.model.to_x.T, direction)
        outside = direction - x @ self.model.to_x
        apart = np.abs(outside).max()
        used = np.abs(x) > NEARLY * np.abs(x).max(initial=0.0)
        if apart > NEARLY * np.abs(direction).max() or not estimate.determined[used].all():
            return np.nan, np.inf, root**2
        error = root * float(np.linalg.norm(x[kept] @ inverse))
        return float(x @ estimate.value), error, root**2
