"""Where motors of a robot that is simulated forward act: at joints, or along straight tendons."""

from __future__ import annotations

from collections.abc import Sequence
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

    def forces(self, force: Array, bias: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return forces (K, n) of K copies as the model takes them, at joints and actuators.

        Less what is always taken off at joints (nv,) and cables (c,).
        """
        joints, cables = (np.tile(-always, (len(force), 1)) for always in bias)
        joints[:, self.dofs] += force[:, self.joints]
        cables[:, self.cables] += force[:, self.tendons]
        return joints, cables

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

    def positions(self, copies: Sequence[Any]) -> Array:
        """Return positions of K copies, (K, n)."""
        out = np.empty((len(copies), len(self.joints) + len(self.tendons)))
        out[:, self.joints] = np.array([data.qpos for data in copies])[:, self.addresses]
        if self._lines:
            for row, data in zip(out, copies, strict=True):
                mujoco.mj_kinematics(self.model, data)
                row[self.tendons] = [line.length(data) for line in self._lines]
        return out

    def rates(self, copies: Sequence[Any]) -> tuple[Array, Array]:
        """Return velocities and accelerations of K copies, (K, n) each."""
        v, a = np.empty((2, len(copies), len(self.joints) + len(self.tendons)))
        v[:, self.joints] = np.array([data.qvel for data in copies])[:, self.dofs]
        a[:, self.joints] = np.array([data.qacc for data in copies])[:, self.dofs]
        for k, line in zip(self.tendons, self._lines, strict=True):
            for row, data in enumerate(copies):
                slope, bent = (line.slope(self.model, data, dot=dot) for dot in (False, True))
                v[row, k], a[row, k] = slope @ data.qvel, slope @ data.qacc + bent @ data.qvel
        return v, a
