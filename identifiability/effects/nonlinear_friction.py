"""Friction beyond Coulomb and viscous: Stribeck, quadratic and load-dependent.

All three act along the actuated joints and coupled motors. Each is linear in its level once its
shape (the Stribeck velocity) or its load (from the robot file's masses) is given.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from identifiability.effects.effect import Effect, axis_motion, put
from identifiability.effects.nominal import rigid_torque
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis

#: Stribeck velocity where none is given, as a share of the joint's speed limit.
TYPICAL_SHARE = 0.1
#: Speed of joints without a limit [rad/s, m/s].
TYPICAL_SPEED = (2.0, 0.3)


def chosen_axes(robot: Robot, only: str | None = None) -> list[tuple[int, Axis]]:
    """Return the axes of actuated joints and coupled motors, or the one that is asked for."""
    return [(k, a) for k, a in enumerate(robot.axes) if only is None or a.name == only]


def typical_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed limit of an axis, or a typical one where it has none [rad/s or m/s]."""
    at = np.flatnonzero(axis.row) if axis.row is not None else np.empty(0, int)
    limits = robot.speed_limits[at]
    known = limits[np.isfinite(limits)]
    return float(known.max()) if len(known) else TYPICAL_SPEED[axis.prismatic]


def _drag_unit(axis: Axis) -> str:
    return "N·s²/m²" if axis.prismatic else "N·m·s²/rad²"


@frozen
class StribeckFriction(Effect):
    """``τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)``: friction that falls as motion begins.

    The level is the excess of static over Coulomb friction and cannot be negative. Source:
    [Olsson 1998, Eq. 4]; the paper prints it without minus sign [Díaz 2010, Eq. 20]. Over a narrow
    range of speeds it looks like Coulomb with quadratic friction.

    Attributes
    ----------
    velocity : float or None [rad/s or m/s]
        Stribeck velocity vs; None takes the robot's, else a tenth of each joint's speed limit.
    only : str or None
        One axis; None for all.
    """

    velocity: float | None = None
    only: str | None = None
    name: str = field(default="stribeck_friction", init=False)
    equation: str = field(default="τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)", init=False)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the excess Fs − Fc of every axis."""
        return tuple(
            Parameter(a.name, "Fs", "N" if a.prismatic else "N·m", self.name, a.symbol)
            for _, a in chosen_axes(robot, self.only)
        )

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the Stribeck velocity of every axis."""
        axes = [axis for _, axis in chosen_axes(robot, self.only)]
        return {f"{axis.name}.{self.name}": self._velocity(robot, axis) for axis in axes}

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        for k, (_, axis) in enumerate(chosen_axes(robot, self.only)):
            speed, _, row = axis_motion(robot, motion, axis)
            share = np.abs(speed / self._velocity(robot, axis))
            put(out, k, row, np.exp(-share) * np.sign(speed))

    def _velocity(self, robot: Robot, axis: Axis) -> float:
        stated = self.velocity or robot.shapes.get(f"{axis.name}.{self.name}")
        return stated or TYPICAL_SHARE * typical_speed(robot, axis)


@frozen
class QuadraticFriction(Effect):
    """``τ = Fq |q̇| q̇``: drag that grows with the square of speed (fans, oil, air).

    Source: [Armstrong-Hélouvry 1994, Sec. 2]. Over a narrow range of speeds it looks like viscous
    friction, or like a wide Stribeck curve.
    """

    name: str = field(default="quadratic_friction", init=False)
    equation: str = field(default="τ = Fq |q̇| q̇", init=False)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return Fq of every axis."""
        return tuple(
            Parameter(
                a.name, "Fq", "N·s²/m²" if a.prismatic else "N·m·s²/rad²", self.name, a.symbol
            )
            for _, a in chosen_axes(robot)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        for k, (_, axis) in enumerate(chosen_axes(robot)):
            speed, _, row = axis_motion(robot, motion, axis)
            put(out, k, row, np.abs(speed) * speed)


@frozen
class LoadDependentFriction(Effect):
    """``τ = Fl |τ_load| sign(q̇)``: Coulomb friction in proportion to the load of the gear.

    The load is the rigid-body torque that the robot file's masses predict, so that a column does
    not contain measured torque. Source: [Hamon 2010, Eq. 4]. Where the load hardly changes it looks
    like Coulomb friction.
    """

    name: str = field(default="load_dependent_friction", init=False)
    equation: str = field(default="τ = Fl |τ_load| sign(q̇)", init=False)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the dimensionless Fl of every axis."""
        return tuple(
            Parameter(a.name, "Fl", "1", self.name, a.symbol) for _, a in chosen_axes(robot)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        load = rigid_torque(robot, motion)
        for k, (_, axis) in enumerate(chosen_axes(robot)):
            speed, _, row = axis_motion(robot, motion, axis)
            assert axis.row is not None
            carried = np.abs(load @ axis.row) / float(axis.row @ axis.row)
            put(out, k, row, carried * np.sign(speed))
