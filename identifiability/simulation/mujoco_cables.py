"""Straight tendons of a robot file in MuJoCo's terms, read from the compiled model itself."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot


@frozen
class StraightCable:
    """A tendon that runs straight from site to site: pairs of sites, and how much each counts."""

    sites: tuple[tuple[int, int, float], ...]

    def length(self, data: Any) -> float:
        """Return its length [m]."""
        apart = [part * np.linalg.norm(data.site_xpos[b] - data.site_xpos[a])
                 for a, b, part in self.sites]  # fmt: skip
        return float(sum(apart))

    def slope(self, model: Any, data: Any, *, dot: bool) -> Array:
        """Return the derivative of the length, (nv,), or that derivative's by time times speed."""
        total = np.zeros(model.nv)
        for a, b, part in self.sites:
            apart = data.site_xpos[b] - data.site_xpos[a]
            length = float(np.linalg.norm(apart))
            along, moved = apart / length, self._apart(model, data, a, b, mujoco.mj_jac)
            if not dot:
                total += part * along @ moved
                continue
            across = (moved @ data.qvel) @ (np.eye(3) - np.outer(along, along)) @ moved
            bent = along @ self._apart(model, data, a, b, mujoco.mj_jacDot)
            total += part * (bent + across / length)
        return total

    @staticmethod
    def _apart(model: Any, data: Any, a: int, b: int, jacobian: Any) -> Array:
        """Return by what the joints move one site away from the other, (3, nv)."""
        ends = [np.zeros((3, model.nv)), np.zeros((3, model.nv))]
        for J, site in zip(ends, (a, b), strict=True):
            jacobian(model, data, J, None, data.site_xpos[site], int(model.site_bodyid[site]))
        return ends[1] - ends[0]


def find_cables(model: Any, robot: Robot) -> list[StraightCable]:
    """Return the tendons that are coordinates of the robot, in its order."""
    out = []
    for cable in robot.cables:
        names = [model.tendon(t).name or f"tendon{t + 1}" for t in range(model.ntendon)]
        t, part, before = names.index(cable.name), 1.0, -1
        sites: list[tuple[int, int, float]] = []
        for w in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
            if model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_PULLEY:
                part, before = 1.0 / float(model.wrap_prm[w]), -1
                continue
            site = int(model.wrap_objid[w])
            if before >= 0:
                sites.append((before, site, part))
            before = site
        out.append(StraightCable(tuple(sites)))
    return out
