"""Torque that depends on position: springs and ripple.

A spring returns the joint to where it is relaxed; ripple repeats with the pitch of a screw, the
teeth of a gear or the poles of a motor.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from identifiability.effects.effect import Effect, axis_motion, put
from identifiability.effects.nonlinear_friction import chosen_axes
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


def travel(robot: Robot, motion: Motion, axis: Axis) -> Array:
    """Return the position of an axis from its home, (N,) [rad or m]."""
    assert axis.row is not None
    home = robot.actuated_positions(robot.home[None])[0]
    position: Array = (motion.actuated_q - home) @ axis.row
    return position


def stretch(robot: Robot, motion: Motion, axis: Axis) -> Array:
    """Return how far an axis is from where its spring is relaxed, (N,) [rad or m]."""
    if axis.row is None:
        extended: Array = robot.dof_position(motion.q, axis.name) - robot.rest[axis.name]
        return extended
    home = robot.actuated_positions(robot.home[None])[0]
    rest = [robot.rest.get(j, at) for j, at in zip(robot.joints, home, strict=True)]
    position: Array = (motion.actuated_q - rest) @ axis.row
    return position


@frozen
class JointStiffness(Effect):
    """``τ = K (q − q_rest)``: a spring, a cable or a hose along the joint.

    It is relaxed where the robot file says, else at home; another neutral position adds a torque
    offset. Passive joints have one where the file states it. Source: [Khalil 2002, Sec. 9.4]. Over
    small angles it looks like gravity.
    """

    name: str = field(default="joint_stiffness", init=False)
    equation: str = field(default="τ = K (q − q_rest)", init=False)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return K of every axis."""
        return tuple(
            Parameter(a.name, "K", "N/m" if a.prismatic else "N·m/rad", self.name, a.symbol)
            for a in _sprung_axes(robot)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        for k, axis in enumerate(_sprung_axes(robot)):
            _, _, row = axis_motion(robot, motion, axis)
            put(out, k, row, stretch(robot, motion, axis))


def _sprung_axes(robot: Robot) -> list[Axis]:
    """Return actuated joints and coupled motors, and the passive joints with a spring."""
    return [*robot.axes, *(a for a in robot.passive_axes if a.name in robot.rest)]


@frozen
class PositionRipple(Effect):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)``: cogging, screw pitch, gear teeth.

    Source: [Holmes 1988; Bittencourt 2012, Sec. 3]. A period as long as the range looks like a
    spring or like gravity.

    Attributes
    ----------
    period : float or None [rad or m]
        Period λ; None takes the robot's, else a sixth of each joint's range.
    only : str or None
    """

    period: float | None = None
    only: str | None = None
    name: str = field(default="position_ripple", init=False)
    equation: str = field(default="τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)", init=False)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the two amplitudes of every axis."""
        return tuple(
            Parameter(a.name, kind, "N" if a.prismatic else "N·m", self.name, a.symbol)
            for _, a in chosen_axes(robot, self.only)
            for kind in ("Rs", "Rc")
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write two columns an axis."""
        for k, (at, axis) in enumerate(chosen_axes(robot, self.only)):
            phase = 2 * np.pi * travel(robot, motion, axis) / self._length(robot, at, axis)
            out[:, :, 2 * k] = np.sin(phase)[:, None] * axis.row
            out[:, :, 2 * k + 1] = np.cos(phase)[:, None] * axis.row

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the period of every axis."""
        axes = chosen_axes(robot, self.only)
        return {f"{axis.name}.{self.name}": self._length(robot, at, axis) for at, axis in axes}

    def _length(self, robot: Robot, at: int, axis: Axis) -> float:
        stated = self.period or robot.shapes.get(f"{axis.name}.{self.name}")
        if stated:
            return stated
        low, high = robot.limits[at] if at < len(robot.limits) else (-np.inf, np.inf)
        if np.isfinite(high - low):
            return float(high - low) / 6
        return 0.03 if axis.prismatic else np.pi / 6
