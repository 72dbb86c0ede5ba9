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

    def _world(self, data: Any, end: int) -> Array:
        rotation = data.xmat[self.body[end]].reshape(3, 3)
        at: Array = data.xpos[self.body[end]] + rotation @ self.point[end]
        return at

    def _turn(self, data: Any) -> Array:
        turn: Array = data.xmat[self.frame].reshape(3, 3).T
        return turn

    def error(self, data: Any) -> Array:
        """Return how far the points are apart in the demanded directions, (k,) [m]."""
        apart = self._turn(data) @ (self._world(data, 0) - self._world(data, 1))
        return np.asarray(apart[[*self.axes]])

    def gradient(self, model: Any, data: Any) -> Array:
        """Return the derivative of the error, (k, nv)."""
        apart = self._apart(model, data, mujoco.mj_jac)
        if self.frame:
            apart = self._turn(data) @ apart
        return apart if len(self.axes) == 3 else apart[[*self.axes]]

    def gradient_rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of the same, (k, nv)."""
        turn, seen = self._turn(data), self._apart(model, data, mujoco.mj_jac)
        rate = turn @ self._apart(model, data, mujoco.mj_jacDot)
        if self.frame:
            spin = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, None, spin, np.zeros(3), self.frame)
            rate += turn @ np.cross(seen @ data.qvel, spin, axisb=0, axisc=0)
            rate += np.cross(spin @ data.qvel, turn) @ seen
        return np.asarray(rate[[*self.axes]])

    def _apart(self, model: Any, data: Any, jacobian: Any) -> Array:
        """Return by what joints move the points apart, as seen from the frame, (3, nv)."""
        J = np.zeros((2, 3, model.nv))
        for end in (0, 1):
            jacobian(model, data, J[end], None, self._world(data, end), self.body[end])
        total: Array = J[0] - J[1]
        if self.frame:
            for end in (0, 1):
                jacobian(model, data, J[end], None, self._world(data, end), self.frame)
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
