"""The equations of a robot's closures: errors, Jacobians and bias, for batches of samples."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.description import Description
from identifiability.robot.kinematics import Point
from identifiability.robot.parts import Coupling, Term


def loop_equations(robot: Description, q: Array) -> tuple[Array, Array]:
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
        error, row = _coupling_error(coupling, q, robot)
        errors[k], J[k] = error, row.T
    return errors, J if len(robot.loop_rows) == m else J[robot.loop_rows]


def loop_jacobian(robot: Description, q: Array) -> Array:
    """Return the Jacobian of the independent loop equations at configurations, (N, n_e, nv)."""
    return np.ascontiguousarray(np.moveaxis(loop_equations(robot, q)[1], -1, 0))


def loop_bias(robot: Description, q: Array, v: Array) -> Array:
    """Return ``Ȧ v`` of the independent loop equations, (N, n_e)."""
    tree = robot.tree
    points: list[Point] = [p for loop in robot.loops for p in (loop.first, loop.second)]
    frames = tree.frames(q, (p.joint for p in points))
    bias = tree.bias_accelerations(frames, v, points)
    rows = []
    for k, loop in enumerate(robot.loops):
        apart = (bias[2 * k] - bias[2 * k + 1])[list(loop.axes)]
        rows.append(np.broadcast_to(apart, (len(loop.axes), len(q))))
    rows += [_coupling_bias(c, q, v, robot)[None] for c in robot.couplings]
    bias_rows: Array = np.concatenate(rows)[robot.loop_rows].T
    return bias_rows


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
