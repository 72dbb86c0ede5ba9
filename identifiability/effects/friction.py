"""Friction that is linear in its parameters, at actuated joints, coupled motors and passive joints.

Symmetric and asymmetric Coulomb friction and viscous friction follow [Díaz 2010, Eq. 10] with the
condition on the velocity (the paper prints it on the position).
"""

from __future__ import annotations

import numpy as np

from identifiability.effects.effect import Effect, axis_motion, put
from identifiability.foundation.names import Array, Parameter, joint_unit
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis


def joint_parameter(axis: Axis, kind: str, group: str) -> Parameter:
    """Return the parameter of one kind at an axis."""
    unit = joint_unit(kind, prismatic=axis.prismatic)
    return Parameter(axis.name, kind, unit, group, axis.symbol)


class ViscousFriction(Effect):
    """``τ = Fv q̇`` at every actuated joint and coupled motor."""

    name = "viscous_friction"
    equation = "τ = Fv q̇"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return Fv of every axis."""
        return tuple(joint_parameter(a, "Fv", self.name) for a in robot.axes)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        for k, axis in enumerate(robot.axes):
            speed, _, row = axis_motion(robot, motion, axis)
            put(out, k, row, speed)


class CoulombFriction(Effect):
    """``τ = Fc sign(q̇)``, the same level for both directions."""

    name = "coulomb_friction"
    equation = "τ = Fc sign(q̇)"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return Fc of every axis."""
        return tuple(joint_parameter(a, "Fc", self.name) for a in robot.axes)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column an axis."""
        for k, axis in enumerate(robot.axes):
            speed, _, row = axis_motion(robot, motion, axis)
            put(out, k, row, np.sign(speed))


class CoulombAsymmetry(Effect):
    """Coulomb friction with a level for each direction; both are positive numbers.

    A motor that mixes joints has one level: what its two directions differ by is a constant torque
    on its joints, which their own levels hold already.
    """

    name = "coulomb_asymmetry"
    equation = "τ = Fc⁺ for q̇ > 0, −Fc⁻ for q̇ < 0"
    supersedes = ("coulomb_friction",)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return Fc+ and Fc- of every joint, Fc of every motor that mixes joints."""
        return tuple(
            joint_parameter(a, kind, self.name)
            for a in robot.axes
            for kind in (("Fc",) if a.mixed else ("Fc+", "Fc-"))
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write two columns a joint, one a motor that mixes joints."""
        k = 0
        for axis in robot.axes:
            speed, _, row = axis_motion(robot, motion, axis)
            if axis.mixed:
                put(out, k, row, np.sign(speed))
                k += 1
                continue
            put(out, k, row, (speed > 0).astype(float))
            put(out, k + 1, row, -(speed < 0).astype(float))
            k += 2


class PassiveJointFriction(Effect):
    """Viscous and Coulomb friction at passive joints, projected on the actuated ones by -Xᵀ."""

    name = "passive_joint_friction"
    equation = "τ = −Xᵀ (Fv q̇ₑ + Fc sign(q̇ₑ))"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return Fv and Fc of every passive one-dof joint."""
        kinds = ("Fv", "Fc")
        return tuple(
            joint_parameter(a, kind, self.name) for a in robot.passive_axes for kind in kinds
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write two columns a passive joint."""
        for k, axis in enumerate(robot.passive_axes):
            speed, _, row = axis_motion(robot, motion, axis)
            put(out, 2 * k, row, speed)
            put(out, 2 * k + 1, row, np.sign(speed))
