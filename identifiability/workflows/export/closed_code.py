"""The parts of generated Python that close the loops of a closed chain, by Newton's method."""

from __future__ import annotations

from identifiability.robot import Robot
from identifiability.workflows.export.statements import indent, names_text, write_statements
from identifiability.workflows.export.symbols import loop_symbols

CLOSED_PYTHON = '''\
"""Inverse dynamics of {title}, {count} besides its loops.

{values}

Positions of passive joints follow from the loops, by Newton's method from the assembly at home.
A controller gives the last configuration as `seed`, which is faster:

    tau = inverse_dynamics(q, v, a)  # the torques alone
    x = close_loops(q, seed=x)  # positions of all joints, from the last ones
    tau = inverse_dynamics(q, v, a, seed=x)
"""

import math

import numpy as np

#: The joints with motors, in the order of all columns, and those that follow them.
JOINTS = {joints}
PASSIVE = {passive}

#: Positions of all joints in the assembly that is meant.
HOME = np.array({home})

#: Where joints are in positions of all of them, and in velocities.
PLACES, ACTUATED, DEPENDENT = {places}, {actuated}, {dependent}

#: Loop errors at which Newton stops, and above which loops are not closed [m or rad].
TOLERANCE, ACCEPTED = 1e-12, 1e-9

#: Steps on the straight way from home to a position, after each of which loops are closed.
STEPS = 10

{functions}

def inverse_dynamics(q, v, a, seed=None):
    """Return torques [N m or N] (..., {n}) of positions [rad or m], velocities, accelerations.

    They are NaN where the loops do not close. A seed (..., {nq}) is a configuration nearby.
    """
    v, a = (np.moveaxis(np.asarray(y, float), -1, 0) for y in (v, a))
    x, A = _close(q, seed)
    inverse = _invert(A[:, DEPENDENT])
    slope = -_times(inverse, A[:, ACTUATED])
    speed, rate = np.zeros(A.shape[1:]), np.zeros(A.shape[1:])
    speed[ACTUATED], speed[DEPENDENT] = v, _times(slope, v)
    rate[ACTUATED], rate[DEPENDENT] = a, _times(slope, a) - _times(inverse, _bias(x, speed))
    return np.moveaxis(_torque(x, speed, rate, slope), 0, -1)


def close_loops(q, seed=None):
    """Return positions of all joints (..., {nq}) by those with motors; NaN where loops stay open.

    From the seed, a configuration nearby, or else in steps from home.
    """
    return np.moveaxis(_close(q, seed)[0], 0, -1)


def _close(q, seed):
    """Return positions of all joints and the Jacobian of the loops, samples last."""
    q = np.moveaxis(np.asarray(q, float), -1, 0)
    start = HOME if seed is None else np.asarray(seed, float)
    x = np.array(np.moveaxis(np.broadcast_to(start, (*q.shape[1:], {nq})), -1, 0))
    x, _, A = _newton(x, 0)
    count = STEPS if seed is None else 1
    step = (q - x[PLACES]) / count
    for k in range(count):
        move = np.zeros(A.shape[1:])
        move[ACTUATED] = step
        move[DEPENDENT] = -_times(_invert(A[:, DEPENDENT]), _times(A[:, ACTUATED], step))
        x, error, A = _newton(_moved(x, move), 3 if k < count - 1 else 15)
    x[:, ~(error < ACCEPTED)] = np.nan
    return x, A


def _newton(x, most):
    """Return positions after at most so many steps, their largest loop error, the Jacobian."""
    for count in range(most + 1):
        error, A = _loops(x)
        worst = np.abs(error).max(0)
        if count == most or not (worst > TOLERANCE).any():
            break
        move = np.zeros(A.shape[1:])
        move[DEPENDENT] = -_times(_invert(A[:, DEPENDENT]), error)
        move *= np.minimum(1.0, 0.5 / np.maximum(np.abs(move).max(0), 1e-300))
        x = _moved(x, move)
    return x, worst, A


def _invert(A):
    """Return inverses of matrices (m, r, ...); with more rows than columns least-squares ones."""
    return np.moveaxis(np.linalg.{invert}(np.moveaxis(A, (0, 1), (-2, -1))), (-2, -1), (0, 1))


def _times(A, y):
    """Return products of matrices (m, r, ...) with vectors (r, ...) or matrices (r, n, ...)."""
    return np.einsum("ij...,j...->i..." if y.ndim < A.ndim else "ij...,jk...->ik...", A, y)


def _moved(x, move):
    """Return positions of all joints after a small motion."""
{moved}


def _loops(x):
    """Return the errors of the loop equations (m, ...), and their Jacobian (m, {nv}, ...)."""
    error, A = np.zeros(({m}, *x.shape[1:])), np.zeros(({m}, {nv}, *x.shape[1:]))
{loops}
    return error, A


def _bias(x, v):
    """Return what the loop equations add to accelerations because of velocities (m, ...)."""
    bias = np.zeros(({m}, *x.shape[1:]))
{bias}
    return bias


def _torque(q, v, a, slope):
    """Return the torque of the joints with motors from the motion of all joints."""
    tau = np.zeros(({n}, *q.shape[1:]))
{torque}
    return tau
'''

_STRAIGHT = "    return x + move"

_TURNING = """\
    rate = np.zeros(x.shape)
{rates}
    x = x + rate
    for start in {quaternions}:
        x[start : start + 4] /= np.sqrt((x[start : start + 4] ** 2).sum(0))
    return x"""


def closed_parts(robot: Robot) -> dict[str, object]:
    """Return what stands in the template for a closed chain, by name."""
    loops, bias, rates = loop_symbols(robot)
    balls = [j.iq + j.nq - 4 for j in robot.tree.joints if j.nv > 1]
    moved = _STRAIGHT
    if balls:
        body = indent(write_statements(rates, "python", ("x", "move"), ("rate",)))
        moved = _TURNING.format(rates=body, quaternions=(*balls,))
    single = robot.tree.single
    return {
        "passive": names_text(robot.passive),
        "home": [float(x) for x in robot.home],
        "places": [single[name].iq for name in robot.joints],
        "actuated": robot.actuated.tolist(),
        "dependent": robot.dependent.tolist(),
        "nq": len(robot.home),
        "nv": robot.nv,
        "m": robot.equations,
        "invert": "inv" if robot.equations == len(robot.dependent) else "pinv",
        "moved": moved,
        "loops": indent(write_statements(loops, "python", ("x",), ("error", "A"))),
        "bias": indent(write_statements(bias, "python", ("x", "v"), ("bias",))),
    }
