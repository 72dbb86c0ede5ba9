"""Self-contained C and Python from a CasADi function, one statement an operation.

Loops of a closed chain are closed by Newton's method, generated with it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from identifiability.foundation.errors import RobotError
from identifiability.foundation.output import write_text
from identifiability.robot import Robot
from identifiability.workflows.export.symbolic_dynamics import (
    import_casadi,
    loop_symbols,
    torque_symbols,
)

# Statements of C and Python from a CasADi function, one an operation.


Language = Literal["c", "python"]

_BOTH = {
    "OP_ASSIGN": "{0}", "OP_ADD": "{0} + {1}", "OP_SUB": "{0} - {1}", "OP_MUL": "{0} * {1}",
    "OP_DIV": "{0} / {1}", "OP_NEG": "-{0}", "OP_SQ": "{0} * {0}", "OP_TWICE": "2.0 * {0}",
    "OP_INV": "1.0 / {0}", "OP_SIN": "sin({0})", "OP_COS": "cos({0})", "OP_EXP": "exp({0})",
    "OP_SQRT": "sqrt({0})", "OP_FABS": "fabs({0})", "OP_FMIN": "fmin({0}, {1})",
    "OP_FMAX": "fmax({0}, {1})", "OP_TANH": "tanh({0})",
}  # fmt: skip
_OWN: dict[Language, dict[str, str]] = {
    "c": {"OP_SIGN": "(double)(({0} > 0.0) - ({0} < 0.0))"},
    "python": {"OP_SIGN": "sign({0})"},
}

#: What statements of Python call: of one sample with plain numbers, which is three times faster.
FUNCTIONS = '''

def _sign(x):
    """Return the sign of a number."""
    return (x > 0) - (x < 0)


_ARRAYS = (np.sin, np.cos, np.exp, np.sqrt, np.abs, np.fmin, np.fmax, np.sign, np.tanh)
_PLAIN = (math.sin, math.cos, math.exp, math.sqrt, abs, min, max, _sign, math.tanh)


def _ready(*arrays):
    """Return arrays, samples last, as lists for one sample; and the functions to use with them."""
    if arrays[0].ndim > 1:
        return *arrays, _ARRAYS
    return *(x.tolist() for x in arrays), _PLAIN
'''


def write_statements(
    function: Any, language: Language, inputs: Sequence[str], outputs: Sequence[str]
) -> Iterator[str]:
    """Yield one statement an operation; names are used once, so that all are constants.

    Parameters
    ----------
    function : casadi.Function
        Of one vector or matrix for each of `inputs`; what is written to `outputs` is not zero.
    language : {"c", "python"}
    inputs, outputs : sequence of str
        Names of arrays.
    """
    ca = import_casadi()
    names = {getattr(ca, name): name for name in (*_BOTH, *_OWN[language])}
    forms = _BOTH | _OWN[language]
    end = ";" if language == "c" else ""
    start = "const double " if language == "c" else ""
    given_at = [_places(function.sparsity_in(k)) for k in range(function.n_in())]
    found_at = [_places(function.sparsity_out(k)) for k in range(function.n_out())]
    if language == "python":
        ready = ", ".join(inputs[: function.n_in()])
        yield f"{ready}, (sin, cos, exp, sqrt, fabs, fmin, fmax, sign, tanh) = _ready({ready})"
    names_of: dict[int, str] = {}
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        out, given = function.instruction_output(k), function.instruction_input(k)
        name = f"x{k}"
        if kind == ca.OP_CONST:
            value = float(function.instruction_constant(k))
            names_of[out[0]] = repr(value) if value >= 0 else f"({value!r})"
        elif kind == ca.OP_INPUT:
            names_of[out[0]] = name
            yield f"{start}{name} = {inputs[given[0]]}{given_at[given[0]][given[1]]}{end}"
        elif kind == ca.OP_OUTPUT:
            yield f"{outputs[out[0]]}{found_at[out[0]][out[1]]} = {names_of[given[0]]}{end}"
        else:
            yield f"{start}{name} = {forms[names[kind]].format(*(names_of[g] for g in given))}{end}"
            names_of[out[0]] = name


def _places(sparsity: Any) -> list[str]:
    """Return the index of every entry that is not zero by its structure."""
    rows, columns = sparsity.row(), sparsity.get_col()
    if sparsity.size2() == 1:
        return [f"[{row}]" for row in rows]
    return [f"[{row}][{column}]" for row, column in zip(rows, columns, strict=True)]


def names_text(names: Iterable[str]) -> str:
    """Return names as a tuple of Python."""
    return f"({' '.join(f'{json.dumps(name)},' for name in names)})"


def comment_text(text: str) -> str:
    """Return a text of a robot file as it may stand in a comment, which it cannot end."""
    return " ".join(re.sub(r"[^\w .,:()+-]", " ", text).split())


def indent(lines: Iterable[str]) -> str:
    """Return the body of a function."""
    return "\n".join(f"    {line}" for line in lines)


# The parts of generated Python that close the loops of a closed chain, by Newton's method.


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


# Straight C and Python from a CasADi function: self-contained, without any package but numpy.


_C = """\
/* Inverse dynamics of {title}, {count}.
   {values}
   inverse_dynamics(q, v, a, tau): positions [rad or m], velocities and accelerations in,
   torques [N m or N] out, of the joints
     {joints}
   in this order. */
#include <math.h>

void inverse_dynamics(const double q[{n}], const double v[{n}], const double a[{n}],
                      double tau[{n}]);

void inverse_dynamics(const double q[{n}], const double v[{n}], const double a[{n}],
                      double tau[{n}])
{{
{torque}
}}
"""

_PYTHON = '''\
"""Inverse dynamics of {title}, {count}.

{values}
"""

import math

import numpy as np

#: The joints, in the order of all columns.
JOINTS = {joints}

{functions}

def inverse_dynamics(q, v, a):
    """Return torques [N m or N] (..., {n}) of positions [rad or m], velocities, accelerations."""
    q, v, a = (np.moveaxis(np.asarray(x, float), -1, 0) for x in (q, v, a))
    tau = np.zeros(q.shape)
{torque}
    return np.moveaxis(tau, 0, -1)
'''


def write_code(
    robot: Robot,
    values: Mapping[str, float],
    shapes: Mapping[str, float],
    path: Path,
    language: Language,
) -> Path:
    """Write a function of positions, velocities and accelerations that returns torques.

    Parameters
    ----------
    robot : Robot
        In C a tree.
    values, shapes : mapping
        Standard parameters, and shapes of effects, by name.
    path : Path
    language : {"c", "python"}

    Raises
    ------
    RobotError
        If C is asked for a closed chain.
    IdentifiabilityError
        If there is no CasADi, or something has no code.
    """
    if robot.closed and language == "c":
        raise RobotError(
            f"C is generated for trees, and {robot.name} is a closed chain: export it as Python "
            "(.py), which closes the loops."
        )
    function = torque_symbols(robot, values, shapes)
    lines = list(write_statements(function, language, ("q", "v", "a", "slope"), ("tau",)))
    known = "; what is known of its torque beforehand is not in it" if robot.known_torque else ""
    texts = {
        "title": comment_text(robot.title),
        "count": f"{len(lines)} statements",
        "values": f"Generated with the {sum(map(bool, values.values()))} values of a fitted "
        f"model{known}.",
        "joints": names_text(robot.joints)
        if language == "python"
        else ", ".join(map(comment_text, robot.joints)),
        "n": len(robot.joints),
        "torque": indent(lines),
        "functions": FUNCTIONS,
    }
    template = _C if language == "c" else _PYTHON
    if robot.closed:
        template = CLOSED_PYTHON
        texts |= closed_parts(robot)
    return write_text(path, template.format(**texts))
