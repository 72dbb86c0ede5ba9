"""Point closures of a robot on the other road, in MuJoCo's terms."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.parts import Loop


@frozen
class PointClosure:
    """A point closure: two bodies and a point in the frame of each.

    Attributes
    ----------
    body : (int, int)
    point : two (3,) [m]
    axes : tuple of int
        Directions in which it is demanded.
    frame : int
        The body whose directions they are, the world by default.
    """

    body: tuple[int, int]
    point: tuple[Array, Array]
    axes: tuple[int, ...] = (0, 1, 2)
    frame: int = 0

    def points(self, data: Any) -> list[Array]:
        """Return where both points are, (3,) each [m]."""
        ends = zip(self.body, self.point, strict=True)
        return [data.xpos[body] + data.xmat[body].reshape(3, 3) @ point for body, point in ends]

    def _turn(self, data: Any) -> Array:
        turn: Array = data.xmat[self.frame].reshape(3, 3).T
        return turn

    def apart(self, model: Any, data: Any) -> tuple[Array, Array]:
        """Return how far the points are apart as demanded (k,) [m], and its derivative (k, nv)."""
        points = self.points(data)
        error, change = points[0] - points[1], self._moved(model, data, points, mujoco.mj_jac)
        if self.frame:
            error, change = self._turn(data) @ error, self._turn(data) @ change
        return error[[*self.axes]], change[[*self.axes]]

    def gradient_rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of that derivative, (k, nv)."""
        points = self.points(data)
        rate = self._moved(model, data, points, mujoco.mj_jacDot)
        if self.frame:
            turn, seen = self._turn(data), self._moved(model, data, points, mujoco.mj_jac)
            rate = turn @ rate
            spin = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, None, spin, np.zeros(3), self.frame)
            rate += turn @ np.cross(seen @ data.qvel, spin, axisb=0, axisc=0)
            rate += np.cross(spin @ data.qvel, turn) @ seen
        return np.asarray(rate[[*self.axes]])

    def _moved(self, model: Any, data: Any, points: list[Array], jacobian: Any) -> Array:
        """Return by what joints move the points apart, as seen from the frame, (3, nv)."""
        J = np.zeros((2, 3, model.nv))
        for end, at, body in zip(J, points, self.body, strict=True):
            jacobian(model, data, end, None, at, body)
        total: Array = J[0] - J[1]
        if self.frame:
            for end, at in zip(J, points, strict=True):
                jacobian(model, data, end, None, at, self.frame)
            total -= J[0] - J[1]
        return total


def find_closures(model: Any, robot: Robot) -> list[PointClosure]:
    """Return the point closures of the MJCF, or of the sidecar where it has its own."""
    if any(loop.stated is not None for loop in robot.loops):
        return [_stated(model, loop) for loop in robot.loops]
    out = []
    for k in range(model.neq if robot.loops else 0):  # a flag of the file may open them all
        weld = model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
        if not (weld or model.eq_type[k] == mujoco.mjtEq.mjEQ_CONNECT) or not model.eq_active0[k]:
            continue
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        data, turns = model.eq_data[k], [np.array([1.0, 0.0, 0.0, 0.0])] * 2
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = (int(model.site_bodyid[first]), int(model.site_bodyid[second]))
            points = (np.array(model.site_pos[first]), np.array(model.site_pos[second]))
            turns = [model.site_quat[first], model.site_quat[second]]
        elif weld:
            bodies, points = (first, second), (np.array(data[3:6]), np.array(data[:3]))
            turns[0] = data[6:10]
        else:
            bodies, points = (first, second), (np.array(data[:3]), np.array(data[3:6]))
        out.append(PointClosure(bodies, points))
        if weld and data[10]:  # with their torque bodies share two more points
            out += [PointClosure(bodies, _shifted(points, turns, e)) for e in np.eye(3)[:2]]
    return out


def _stated(model: Any, loop: Loop) -> PointClosure:
    assert loop.stated is not None
    (first, at), (second, there) = loop.stated
    bodies = (int(model.body(first).id), int(model.body(second).id))
    frame = 0 if loop.frame is None else int(model.body(loop.frame.body).id)
    return PointClosure(bodies, (np.array(at), np.array(there)), loop.axes, frame)


def _shifted(points: tuple[Array, Array], turns: list[Array], by: Array) -> tuple[Array, Array]:
    """Return points that lie some way from others along the axes of two turned frames."""
    out = [np.zeros(3), np.zeros(3)]
    for end, (point, turn) in enumerate(zip(points, turns, strict=True)):
        mujoco.mju_rotVecQuat(out[end], by, np.array(turn))
        out[end] += point
    return out[0], out[1]
