"""Torque that is recorded later than the motion it belongs to."""

import numpy as np

from identifiability.effects.actuator_inertia import ActuatorInertia
from identifiability.effects.coulomb_asymmetry import CoulombAsymmetry
from identifiability.effects.coulomb_friction import CoulombFriction
from identifiability.effects.effect import Effect
from identifiability.effects.family import actuated_joints
from identifiability.effects.joint_stiffness import JointStiffness
from identifiability.effects.nominal import (
    Torque,
    needs_masses,
    once,
    reference_values,
    rigid_torque,
)
from identifiability.effects.registry import declare
from identifiability.effects.viscous_friction import ViscousFriction
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot


@once
def nominal_torque(robot: Robot, motion: Motion) -> Array:
    """Return the torque by all values that the robot file states, (N, n)."""
    tau = rigid_torque(robot, motion)
    effects: list[Effect] = [ViscousFriction(), ActuatorInertia(), JointStiffness()]
    known = reference_values(robot)
    stated = any(k.endswith(".Fc+") for k in known)
    effects.append(CoulombAsymmetry() if stated else CoulombFriction())
    for effect in effects:
        parameters = effect.parameters(robot)
        W = np.zeros((*tau.shape, len(parameters)))
        effect.fill(robot, motion, W)
        tau = tau + W @ np.array([known.get(p.name, 0.0) for p in parameters])
    return tau


@declare(
    "a delay of the torque",
    actuated_joints,
    refuse=needs_masses,
    loaded=True,
    native=True,
    rank=12,
)
@frozen
class TimeDelay(Effect):
    """``τ_measured(t) = τ(t − δ) ≈ τ − δ dτ/dt``: torque and motion are not sampled together.

    Linearised in the delay, which must be small beside the fastest motion. The torque that is
    differentiated is a model's, never the measured one, whose noise would enter the column.
    It looks like actuator inertia and viscous friction at one frequency of motion. A delay is never
    negative: torque that comes before its motion is a `clock_error`.

    Attributes
    ----------
    torque : callable(Robot, Motion) -> (N, n)
        Model torque; by default that of the robot file's values.
    """

    torque: Torque = nominal_torque
    name = "time_delay"
    equation = "τ = −δ dτ/dt"
    source = "[Ljung 1999, Sec. 4.2]"
    kind = "delay"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return that of every actuated joint."""
        return tuple(
            Parameter(a.name, self.kind, "s", self.name, a.symbol, nonnegative=True)
            for a in robot.axes[: len(robot.actuated)]
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write one column a joint; differences do not reach across missing samples."""
        if len(motion) < 3:
            return
        tau = self.torque(robot, motion)
        gaps = np.flatnonzero(np.diff(motion.kept) != 1) + 1
        for rows in np.split(np.arange(len(motion)), gaps):
            if len(rows) > 2:
                slope = np.gradient(tau[rows], motion.t[rows], axis=0)
                for k in range(out.shape[1]):
                    out[rows, k, k] = -slope[:, k]
