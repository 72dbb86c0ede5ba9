"""`Effect`: a block of named columns of the regressor as a function of the motion.

`AlongAxes` is what most effects are: forces along joints and motors, in proportion to levels.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.foundation.names import Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


class Effect(ABC):
    """A part of a model: torque that is linear in its parameters.

    Every effect answers three questions: what it is called, which parameters it has for a robot,
    and what their columns are along a motion. Models are sums of effects.
    """

    #: Public name, used in reports, JSON, TOML and on the command line.
    name: str
    #: The equation in words of the literature, for reports.
    equation: str
    #: Where the equation is from.
    source: str = ""
    #: Effects whose columns these already contain; a model drops them.
    supersedes: tuple[str, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """How a ladder file writes the effect."""
        return (self.name,)

    def shapes(self, robot: Robot) -> Mapping[str, float]:
        """Return the shapes behind the columns, by ``<joint>.<effect>``; none for most effects."""
        del robot
        return {}

    @abstractmethod
    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the parameters that the columns multiply."""

    @abstractmethod
    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the columns into `out` (N, n, p), which holds zeros.

        ``out[k] @ phi`` is the torque of the n actuated joints at sample k [N·m or N].
        """


class AlongAxes(Effect):
    """Forces along joints and coupled motors, each in proportion to one parameter.

    A subclass states its `units` and its `forces`, and where it is if not at every actuated axis.
    """

    #: Each kind of parameter, with its SI unit at an axis that turns and at one that slides.
    units: tuple[tuple[str, str, str], ...]

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return where the effect is."""
        return robot.axes

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return the kinds of parameters that an axis has."""
        del robot, axis
        return tuple(kind for kind, _, _ in self.units)

    def unit(self, kind: str, axis: Axis) -> str:
        """Return the SI unit of a kind at an axis."""
        turning, sliding = next(unit for known, *unit in self.units if known == kind)
        return sliding if axis.prismatic else turning

    @abstractmethod
    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the force along the axis per unit of each kind, (N,) each."""

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return every kind of every axis."""
        return tuple(
            Parameter(axis.name, kind, self.unit(kind, axis), self.name, axis.symbol)
            for axis in self.axes(robot)
            for kind in self.kinds(robot, axis)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write a column for every force."""
        column = 0
        for axis in self.axes(robot):
            _, _, row = axis_motion(robot, motion, axis)
            for force in self.forces(robot, motion, axis):
                put(out, column, row, force)
                column += 1


def axis_motion(robot: Robot, motion: Motion, axis: Axis) -> tuple[Array, Array, Array]:
    """Return speed (N,), acceleration (N,) and torque row (N, n) or (n,) of an axis.

    A force f along the axis loads the actuated joints by ``row · f`` (virtual work).
    """
    if axis.row is not None:
        return motion.actuated_v @ axis.row, motion.actuated_a @ axis.row, axis.row
    at = int(np.flatnonzero(robot.dependent == axis.dof)[0])
    assert motion.X is not None
    return motion.v[:, axis.dof], motion.a[:, axis.dof], -motion.X[:, at, :]


def speed_along(robot: Robot, motion: Motion, axis: Axis) -> Array:
    """Return the speed of an axis, (N,) [rad/s or m/s]."""
    return axis_motion(robot, motion, axis)[0]


def travel(robot: Robot, motion: Motion, axis: Axis) -> Array:
    """Return the position of an actuated axis from its home, (N,) [rad or m]."""
    assert axis.row is not None
    home = robot.actuated_positions(robot.home[None])[0]
    position: Array = (motion.actuated_q - home) @ axis.row
    return position


def chosen_axes(robot: Robot, only: str | None) -> list[Axis]:
    """Return the axes of actuated joints and coupled motors, or the one that is asked for."""
    return [a for a in robot.axes if only is None or a.name == only]


def put(out: Array, column: int, row: Array, force: Array) -> None:
    """Write the column of a force (N,) along an axis with torque row (n,) or (N, n)."""
    if row.ndim == 2:
        out[:, :, column] = row * force[:, None]
        return
    for joint in np.flatnonzero(row):
        out[:, joint, column] = row[joint] * force
