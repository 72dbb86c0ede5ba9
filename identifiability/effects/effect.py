"""`Effect`: a block of named columns of the regressor as a function of the motion.

`AlongAxes` is what most effects are: forces along joints and motors, in proportion to levels.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from identifiability.foundation.names import Array, Parameter, find_named
from identifiability.foundation.values import frozen
from identifiability.robot import Axis, Motion, Robot


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
    #: Whether the columns at a sample depend on that sample alone and take long: of samples that
    #: are met again they are taken from where they were.
    pointwise: ClassVar[bool] = False
    #: How many smooth curves the columns at a place are, one after the other, where they are
    #: splines; none where what they say changes most at one point, as friction does at rest.
    curves_apart: ClassVar[int] = 1

    #: How many numbers its shape is, behind the colon of a ladder file.
    shape_size: ClassVar[int] = 0

    def about(self, shape: Sequence[float]) -> "Effect":
        """Return the effect with a shape of several numbers: most have none."""
        raise NotImplementedError(f"{type(self).__name__} has no shape of {len(shape)} numbers")

    def turn(self, robot: Robot) -> Robot:
        """Return the robot that a model with the effect is about: nearly always the same one."""
        return robot

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


@frozen
class Along:
    """The motion along one axis, which the forces along it are functions of."""

    robot: Robot
    motion: Motion
    axis: Axis

    @property
    def speed(self) -> Array:
        """Speed of the axis, (N,) [rad/s or m/s]."""
        return self.robot.along(self.axis, self.motion.v)

    @property
    def sign(self) -> Array:
        """Sign of its speed, (N,): where velocity is noisy, what it is in the mean."""
        return self.motion.expected_sign(self.speed, self.load)

    @property
    def acceleration(self) -> Array:
        """Acceleration of the axis, (N,) [rad/s² or m/s²]."""
        return self.robot.along(self.axis, self.motion.a)

    @property
    def travel(self) -> Array:
        """Position of the axis from its home, (N,) [rad or m]."""
        return self.robot.travel(self.axis, self.motion.q, self.robot.home)

    @property
    def position(self) -> Array:
        """Position of the axis as the robot file counts it, (N,) [rad or m]."""
        return self.robot.travel(self.axis, self.motion.q)

    @property
    def ones(self) -> Array:
        """One at every sample, (N,)."""
        return np.ones(len(self.motion))

    @property
    def load(self) -> Array:
        """What a force f along the axis loads the actuated joints by, ``load · f``, (N, n) or (n,).

        It is the row of their speeds in that of the axis (virtual work).
        """
        if self.axis.row is not None:
            return self.axis.row
        assert self.motion.X is not None
        robot, passive = self.robot, [*self.robot.passive]
        if self.axis.weights is None:
            at = int(np.flatnonzero(robot.dependent == self.axis.dof)[0])
            row: Array = -self.motion.X[:, at, :]
            return row
        row = np.zeros((len(self.motion), len(robot.actuated)))
        for joint, c in self.axis.weights.items():
            if joint in passive:
                row -= c * self.motion.X[:, passive.index(joint), :]
            else:
                row[:, robot.joints.index(joint)] += c
        return row


class AlongAxes(Effect):
    """Forces along joints and coupled motors, each in proportion to one parameter.

    A subclass states its `units` and its `curves`, and what else differs from the words here.
    """

    #: Each kind of parameter, with its SI unit at an axis that turns and at one that slides.
    units: tuple[tuple[str, str, str], ...]
    #: Whether physics forbids levels below zero.
    nonnegative: bool = False
    #: The number of a joint by which a robot file states each kind; see `Parameter.stated_as`.
    stated_as: tuple[str, ...] = ()

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return where the effect is: by default at every actuated joint and coupled motor."""
        return robot.axes

    def kinds(self, robot: Robot, axis: Axis) -> tuple[str, ...]:
        """Return the kinds of parameters that an axis has."""
        del robot, axis
        return tuple(kind for kind, _, _ in self.units)

    def curves(self, at: Along) -> Sequence[Array]:
        """Return the force along an axis per unit of each kind, (N,) each.

        Code is generated from them where they are NumPy's functions of position, travel, speed
        and acceleration.
        """
        raise NotImplementedError(f"{type(self).__name__} states no curves")

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return every kind of every axis."""
        return tuple(
            self._parameter(axis, kind)
            for axis in self.axes(robot)
            for kind in self.kinds(robot, axis)
        )

    def _parameter(self, axis: Axis, kind: str) -> Parameter:
        known = [name for name, _, _ in self.units]
        at = known.index(kind) if kind in known else 0
        _, turning, sliding = self.units[at]
        unit = sliding if axis.prismatic else turning
        stated_as = self.stated_as[at] if self.stated_as else ""
        return Parameter(axis.name, kind, unit, self.name, axis.symbol, self.nonnegative, stated_as)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write a column for every force."""
        column = 0
        for axis in self.axes(robot):
            at = Along(robot, motion, axis)
            load = at.load
            for force in self.curves(at):
                put(out, column, load, force)
                column += 1


@frozen
class Shaped(AlongAxes):
    """Forces whose curve has a shape, such as a period.

    Attributes
    ----------
    given : float or None
        The shape; None takes the robot's, else a typical one for each axis.
    only : str or None
        One axis, or a pattern such as ``wrist_*``; None for all.
    """

    shape_size: ClassVar[int] = 1

    #: The shape where none is stated: at an axis that turns, and at one that slides.
    usual: ClassVar[tuple[float, float]]

    given: float | None = None
    only: str | None = None

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return the shape at an axis for which none is stated."""
        del robot
        return self.usual[axis.prismatic]

    def shape(self, robot: Robot, axis: Axis) -> float:
        """Return the shape at an axis."""
        stated = self.given or robot.shapes.get(f"{axis.name}.{self.name}")
        return stated or self.typical(robot, axis)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the axes of actuated joints and coupled motors, or those that are asked for."""
        asked = find_named(self.only or "*", (a.name for a in robot.axes))
        return [a for a in robot.axes if a.name in asked]

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the shape of every axis."""
        return {f"{a.name}.{self.name}": self.shape(robot, a) for a in self.axes(robot)}


def put(out: Array, column: int, load: Array, force: Array) -> None:
    """Write the column of a force (N,) along an axis that loads the joints by (n,) or (N, n)."""
    if load.ndim == 2:
        out[:, :, column] = load * force[:, None]
        return
    for joint in np.flatnonzero(load):
        out[:, joint, column] = load[joint] * force
