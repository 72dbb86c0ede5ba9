"""Closures of a robot: points that coincide, joints that are coupled, and their equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from identifiability.names import Array
from identifiability.robot.kinematics import Point

if TYPE_CHECKING:
    from identifiability.robot.description import Robot


@dataclass(frozen=True)
class Loop:
    """A point closure: a point of one body coincides with a point of another.

    `axes` are the world directions in which the closure is demanded (a planar loop needs two);
    `stated` is the entry of a sidecar: bodies, and points in their frames.
    """

    name: str
    first: Point
    second: Point
    axes: tuple[int, ...] = (0, 1, 2)
    stated: tuple[tuple[str, tuple[float, ...]], tuple[str, tuple[float, ...]]] | None = None


@dataclass(frozen=True)
class Coupling:
    """A joint coupling ``q_joint = Σ c_k (q_of)^k`` (MJCF ``<joint>`` equality, URDF mimic)."""

    name: str
    joint: str
    of: str | None
    polynomial: tuple[float, ...]

    def evaluate(self, q: Array, robot: Robot) -> tuple[Array, Array]:
        """Return the coupling error (N,) and its Jacobian (N, nv)."""
        J = np.zeros((len(q), robot.nv))
        J[:, robot.dof_index(self.joint)] = 1.0
        x = self._source(q, robot)
        poly = np.polynomial.Polynomial(self.polynomial)
        if self.of is not None:
            J[:, robot.dof_index(self.of)] = -poly.deriv()(x)
        return robot.dof_position(q, self.joint) - poly(x), J

    def bias(self, q: Array, v: Array, robot: Robot) -> Array:
        """Return ``J̇ v``, (N,)."""
        if self.of is None:
            return np.zeros(len(q))
        poly = np.polynomial.Polynomial(self.polynomial)
        rate = v[:, robot.dof_index(self.of)]
        bias: Array = -poly.deriv(2)(self._source(q, robot)) * rate**2
        return bias

    def _source(self, q: Array, robot: Robot) -> Array:
        return robot.dof_position(q, self.of) if self.of is not None else np.zeros(len(q))


def loop_equations(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Return all loop errors and the Jacobian of the independent equations, samples last.

    Parameters
    ----------
    robot : Robot
    q : (N, nq)

    Returns
    -------
    errors : (m, N) [m or rad]
    jacobian : (n_e, nv, N)
    """
    tree, n = robot.tree, len(q)
    ends = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    frames = tree.frames(q, ends)
    m = sum(len(loop.axes) for loop in robot.loops) + len(robot.couplings)
    errors, J = np.empty((m, n)), np.zeros((m, robot.nv, n))
    at = 0
    for loop in robot.loops:
        axes, rows = list(loop.axes), slice(at, at + len(loop.axes))
        whole = J[rows] if len(axes) == 3 else np.zeros((3, robot.nv, n))
        apart = tree.world_point(frames, loop.first) - tree.world_point(frames, loop.second)
        tree.add_point_jacobian(frames, loop.first, 1.0, whole)
        tree.add_point_jacobian(frames, loop.second, -1.0, whole)
        errors[rows] = apart[axes]
        if len(axes) < 3:
            J[rows] = whole[axes]
        at = rows.stop
    for k, coupling in enumerate(robot.couplings, at):
        error, row = coupling.evaluate(q, robot)
        errors[k], J[k] = error, row.T
    return errors, J if len(robot.loop_rows) == m else J[robot.loop_rows]


def loop_jacobian(robot: Robot, q: Array) -> Array:
    """Return the Jacobian of the independent loop equations at configurations, (N, n_e, nv)."""
    return np.ascontiguousarray(np.moveaxis(loop_equations(robot, q)[1], -1, 0))


def loop_bias(robot: Robot, q: Array, v: Array) -> Array:
    """Return ``Ȧ v`` of the independent loop equations, (N, n_e)."""
    tree = robot.tree
    points: list[Point] = [p for loop in robot.loops for p in (loop.first, loop.second)]
    frames = tree.frames(q, (p.joint for p in points))
    bias = tree.bias_accelerations(frames, v, points)
    rows = []
    for k, loop in enumerate(robot.loops):
        apart = (bias[2 * k] - bias[2 * k + 1])[list(loop.axes)]
        rows.append(np.broadcast_to(apart, (len(loop.axes), len(q))))
    rows += [c.bias(q, v, robot)[None] for c in robot.couplings]
    bias_rows: Array = np.concatenate(rows)[robot.loop_rows].T
    return bias_rows
