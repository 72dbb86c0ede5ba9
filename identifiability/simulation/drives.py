"""Where motors of a robot that is simulated forward act: at joints, or along straight tendons."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.names import Array
from identifiability.simulation.mujoco_robot import MujocoRobot


class Drives:
    """The actuated joints of a robot in a MuJoCo model, whose actuators are at its tendons.

    Parameters
    ----------
    kinematics : MujocoRobot
    """

    def __init__(self, kinematics: MujocoRobot) -> None:
        self.model = kinematics.model
        inside = kinematics.actuated < self.model.nv
        #: Which actuated joints are joints of the model, and which are tendons.
        self.joints, self.tendons = np.flatnonzero(inside), np.flatnonzero(~inside)
        self.dofs = kinematics.actuated[inside]
        self.addresses = kinematics.positions[inside]
        #: Their tendons among those of the robot, which are in the order of the actuators.
        self.cables = kinematics.actuated[~inside] - self.model.nv
        self._lines = [kinematics.cables[k] for k in self.cables]
        names = [kinematics.robot.cables[k].name for k in self.cables]
        self._at = np.array([self.model.tendon(name).id for name in names], int)

    def push(self, data: Any, force: Array, bias: tuple[Array, Array]) -> None:
        """Apply forces (n,), less what is always taken off at joints (nv,) and cables (c,)."""
        data.qfrc_applied[:] = -bias[0]
        data.qfrc_applied[self.dofs] += force[self.joints]
        data.ctrl[:] = -bias[1]
        data.ctrl[self.cables] += force[self.tendons]

    @property
    def dry(self) -> Array:
        """Levels of dry friction, (n,)."""
        out = np.empty(len(self.joints) + len(self.tendons))
        out[self.joints] = self.model.dof_frictionloss[self.dofs]
        out[self.tendons] = self.model.tendon_frictionloss[self._at]
        return out

    @dry.setter
    def dry(self, levels: Array) -> None:
        self.model.dof_frictionloss[self.dofs] = levels[self.joints]
        self.model.tendon_frictionloss[self._at] = levels[self.tendons]

    def position(self, data: Any) -> Array:
        """Return positions, (n,)."""
        out = np.empty(len(self.joints) + len(self.tendons))
        out[self.joints] = data.qpos[self.addresses]
        if self._lines:
            mujoco.mj_kinematics(self.model, data)
            out[self.tendons] = [line.length(data) for line in self._lines]
        return out

    def rates(self, data: Any) -> tuple[Array, Array]:
        """Return velocities and accelerations, (n,) each."""
        v, a = np.empty((2, len(self.joints) + len(self.tendons)))
        v[self.joints], a[self.joints] = data.qvel[self.dofs], data.qacc[self.dofs]
        for k, line in zip(self.tendons, self._lines, strict=True):
            slope, bent = (line.slope(self.model, data, dot=dot) for dot in (False, True))
            v[k], a[k] = slope @ data.qvel, slope @ data.qacc + bent @ data.qvel
        return v, a
