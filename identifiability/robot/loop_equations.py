"""The equations of a robot's closures: errors, Jacobians and bias, for batches of samples."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.cables import cable_bias, cable_equation, cable_joints, cable_points
from identifiability.robot.description import Description
from identifiability.robot.kinematics import WORLD, Frames, Point, Tree
from identifiability.robot.parts import Coupling, Loop, LoopFrame, Term
from identifiability.robot.vectors import cross


def loop_equations(robot: Description, q: Array) -> tuple[Array, Array]:
    """Return the errors of all loop equations and their Jacobian, samples last.

    Where there are more equations than dependent joints, those of a whole point are written in the
    axes of its first body: the plane of a planar loop stands still there while it turns in space.
    Directions of a stated body turn with it, and the error is how far apart points are as seen from
    there.

    Parameters
    ----------
    robot : Robot
    q : (N, nq)

    Returns
    -------
    errors : (m, N) [m or rad]
    jacobian : (m, nv, N)
    """
    tree, n = robot.tree, len(q)
    frames = tree.frames(q, [*_loop_joints(robot), *cable_joints(robot)])
    errors, J = np.empty((robot.equations, n)), np.zeros((robot.equations, robot.nv, n))
    at = 0
    for loop in robot.loops:
        axes, rows = list(loop.axes), slice(at, at + len(loop.axes))
        whole = J[rows] if len(axes) == 3 else np.zeros((3, robot.nv, n))
        apart = tree.world_point(frames, loop.first) - tree.world_point(frames, loop.second)
        tree.add_point_jacobian(frames, loop.first, 1.0, whole)
        tree.add_point_jacobian(frames, loop.second, -1.0, whole)
        if loop.frame is not None:
            _see_from(tree, loop.frame, frames, loop, whole)
        turn = _own_axes(robot, loop, frames)
        if turn is not None:
            apart = np.einsum("cxn,xn->cn", turn, apart)
            whole[:] = np.einsum("cxn,xvn->cvn", turn, whole)
        errors[rows] = apart[axes]
        if len(axes) < 3:
            J[rows] = whole[axes]
        at = rows.stop
    for k, coupling in enumerate(robot.couplings, at):
        error, row = _coupling_error(coupling, q, robot)
        errors[k], J[k] = error, row.T
    for k, cable in enumerate(robot.cables, robot.equations - len(robot.cables)):
        errors[k], J[k] = cable_equation(robot, cable, frames, q)
    return errors, J


def loop_jacobian(robot: Description, q: Array) -> Array:
    """Return the Jacobian of the loop equations at configurations, (N, m, nv)."""
    return np.ascontiguousarray(np.moveaxis(loop_equations(robot, q)[1], -1, 0))


def loop_bias(robot: Description, q: Array, v: Array) -> Array:
    """Return ``Ȧ v`` of the loop equations at configurations that close them, (N, m)."""
    tree = robot.tree
    points: list[Point] = [p for loop in robot.loops for p in (loop.first, loop.second)]
    points += cable_points(robot)
    frames = tree.frames(q, [*_loop_joints(robot), *cable_joints(robot)])
    bias = tree.bias_accelerations(frames, v, points)
    rows = []
    for k, loop in enumerate(robot.loops):
        apart, turn = bias[2 * k] - bias[2 * k + 1], _own_axes(robot, loop, frames)
        if loop.frame is not None:
            apart = apart - _frame_bias(tree, loop.frame, frames, loop, v)
        if turn is not None:
            apart = np.einsum("cxn,xn->cn", turn, apart)
        rows.append(np.broadcast_to(apart[list(loop.axes)], (len(loop.axes), len(q))))
    rows += [_coupling_bias(c, q, v, robot)[None] for c in robot.couplings]
    at = 2 * len(robot.loops)
    for cable in robot.cables:
        ends = bias[at : at + 2 * len(cable.segments)]
        rows.append(cable_bias(robot, cable, frames, v, ends)[None])
        at += len(ends)
    bias_rows: Array = np.concatenate(rows).T
    return bias_rows


def _loop_joints(robot: Description) -> list[int]:
    """Return the joints that ends of loops are on, and bodies whose axes they are written in."""
    ends = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    return ends + [loop.frame.joint for loop in robot.loops if loop.frame is not None]


def _see_from(tree: Tree, frame: LoopFrame, frames: Frames, loop: Loop, whole: Array) -> None:
    """Take off what the points would move with a body, from the Jacobian of their distance."""
    for point, sign in ((loop.first, -1.0), (loop.second, 1.0)):
        tree.add_jacobian_at(frames, frame.joint, tree.world_point(frames, point), sign, whole)


def _frame_bias(tree: Tree, frame: LoopFrame, frames: Frames, loop: Loop, v: Array) -> Array:
    """Return what a body that turns takes off the acceleration of a distance, (3, N).

    Of a distance a that moves by u as seen from the body: ``α × a + ω × (ω × a) + 2 ω × u``.
    """
    omega, alpha, _ = tree.bias_motions(frames, v, [frame.joint])[frame.joint]
    first, second = (tree.world_point(frames, p) for p in (loop.first, loop.second))
    whole = np.zeros((3, tree.nv, len(v)))
    tree.add_point_jacobian(frames, loop.first, 1.0, whole)
    tree.add_point_jacobian(frames, loop.second, -1.0, whole)
    _see_from(tree, frame, frames, loop, whole)
    u, a = np.einsum("xvn,nv->xn", whole, v), first - second
    return cross(alpha, a) + cross(omega, cross(omega, a) + 2 * u)


def _own_axes(robot: Description, loop: Loop, frames: Frames) -> Array | None:
    """Return the axes in which a loop is written, (3, 3, N), or None for those of the world."""
    if loop.frame is not None:
        return robot.tree.world_axes(frames, loop.frame.joint, loop.frame.rotation)
    if robot.equations == len(robot.dependent) or len(loop.axes) < 3 or loop.first.joint == WORLD:
        return None
    return frames.axes[loop.first.joint]


def _coupling_error(coupling: Coupling, q: Array, robot: Description) -> tuple[Array, Array]:
    """Return the coupling error (N,) and its Jacobian (N, nv)."""
    J = np.zeros((len(q), robot.nv))
    J[:, robot.dof_index(coupling.joint)] = 1.0
    error = robot.dof_position(q, coupling.joint)
    for term in coupling.terms:
        x, poly = _source(term, q, robot), np.polynomial.Polynomial(term.polynomial)
        error = error - poly(x)
        for joint, weight in term.weights.items():
            J[:, robot.dof_index(joint)] -= weight * poly.deriv()(x)
    return error, J


def _coupling_bias(coupling: Coupling, q: Array, v: Array, robot: Description) -> Array:
    """Return ``J̇ v`` of a coupling, (N,)."""
    bias = np.zeros(len(q))
    for term in coupling.terms:
        poly = np.polynomial.Polynomial(term.polynomial)
        rate = sum(w * v[:, robot.dof_index(joint)] for joint, w in term.weights.items())
        bias -= poly.deriv(2)(_source(term, q, robot)) * rate**2
    return bias


def _source(term: Term, q: Array, robot: Description) -> Array:
    parts = (w * robot.dof_position(q, joint) for joint, w in term.weights.items())
    return sum(parts, np.zeros(len(q)))
