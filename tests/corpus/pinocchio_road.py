"""The torque that Pinocchio finds for a URDF: nothing here is shared with the library.

Pinocchio leaves damping, friction and mimic joints aside; they are taken from the file.
"""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from .mujoco_road import draw


def _with_limits(path):
    """Return a file with limits at every joint: Pinocchio asks for them, dynamics do not."""
    root = ET.parse(path).getroot()
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None:
            ET.SubElement(joint, "limit", lower="-9", upper="9", effort="10", velocity="5")
    return ET.tostring(root, encoding="unicode")


class PinocchioRoad:
    """A URDF.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path):
        self.model = pin.buildModelFromXML(_with_limits(path))
        self.data = self.model.createData()
        nv = self.model.nv
        names = {
            self.model.names[k]: self.model.joints[k].idx_v for k in range(1, self.model.njoints)
        }
        self.damping, self.friction = np.zeros(nv), np.zeros(nv)
        ratio = np.eye(nv)
        shift = np.zeros(nv)
        driven = dict(names)
        self.slides = np.zeros(nv, bool)
        for joint in ET.parse(path).getroot().findall("joint"):
            at = names.get(joint.get("name", ""))
            if at is None:
                continue
            self.slides[at] = joint.get("type") == "prismatic"
            dynamics = joint.find("dynamics")
            mimic = joint.find("mimic")
            if dynamics is not None:
                self.damping[at] = float(dynamics.get("damping", 0))
                self.friction[at] = float(dynamics.get("friction", 0))
            if mimic is not None:
                ratio[at] = 0
                of = mimic.get("joint", "")
                if of in names:  # a fixed joint stays at zero
                    ratio[at, names[of]] = float(mimic.get("multiplier", 1))
                shift[at] = float(mimic.get("offset", 0))
                del driven[joint.get("name", "")]
        self.joints = tuple(driven)
        free = [driven[name] for name in self.joints]
        # A mimic of a mimic follows after as many steps as there are between.
        self.map, self.shift = ratio[:, free], shift
        for _ in range(nv):
            self.map, self.shift = ratio @ self.map, ratio @ self.shift + shift
        assert all(
            np.array_equal(self.map[at], e) for at, e in zip(free, np.eye(len(free)), strict=True)
        )

    def states(self, rng, count, spread):
        """Return random states of the actuated joints, away from zero speed, and their torque."""
        n = len(self.joints)
        single = [self.map[:, k].argmax() for k in range(n)]
        reach = np.where(self.slides[single], 0.2 * spread, spread)
        return draw(self.joints, rng, count, reach, self._torque)

    def _torque(self, q, dq, ddq):
        model = self.model
        v = self.map @ dq
        a = self.map @ ddq
        at = pin.integrate(model, pin.neutral(model), self.map @ q + self.shift)
        force = pin.rnea(model, self.data, at, v, a)
        force = force + self.damping * v + self.friction * np.sign(v)
        return self.map.T @ force
