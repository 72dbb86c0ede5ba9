"""Straight C and Python from a CasADi function: self-contained, without any package but numpy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from identifiability.foundation.output import write_text
from identifiability.robot import Robot
from identifiability.workflows.export.symbols import import_casadi, write_symbols

Language = Literal["c", "python"]

_BOTH = {
    "OP_ASSIGN": "{0}", "OP_ADD": "{0} + {1}", "OP_SUB": "{0} - {1}", "OP_MUL": "{0} * {1}",
    "OP_DIV": "{0} / {1}", "OP_NEG": "-{0}", "OP_SQ": "{0} * {0}", "OP_TWICE": "2.0 * {0}",
    "OP_INV": "1.0 / {0}",
}  # fmt: skip
_WORDS: dict[Language, dict[str, str]] = {
    "c": {"OP_SIN": "sin({0})", "OP_COS": "cos({0})", "OP_EXP": "exp({0})",
          "OP_FABS": "fabs({0})", "OP_SIGN": "(double)(({0} > 0.0) - ({0} < 0.0))"},
    "python": {"OP_SIN": "np.sin({0})", "OP_COS": "np.cos({0})", "OP_EXP": "np.exp({0})",
               "OP_FABS": "np.abs({0})", "OP_SIGN": "np.sign({0})"},
}  # fmt: skip

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
{body}
}}
"""

_PYTHON = '''\
"""Inverse dynamics of {title}, {count}.

{values}
"""

import numpy as np

#: The joints, in the order of all columns.
JOINTS = ({joints},)


def inverse_dynamics(q, v, a):
    """Return torques [N m or N] (..., {n}) of positions [rad or m], velocities, accelerations."""
    q, v, a = (np.asarray(x, float) for x in (q, v, a))
    tau = np.zeros(q.shape)
{body}
    return tau
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
        A tree.
    values, shapes : mapping
        Standard parameters, and shapes of effects, by name.
    path : Path
    language : {"c", "python"}

    Raises
    ------
    IdentifiabilityError
        If there is no CasADi, or something has no code.
    """
    function = write_symbols(robot, values, shapes)
    lines = list(_lines(function, language))
    quote = '"{}"'.format if language == "python" else str
    text = (_C if language == "c" else _PYTHON).format(
        title=robot.title,
        count=f"{len(lines)} operations",
        values=f"Generated with the {sum(map(bool, values.values()))} values of a fitted model.",
        joints=", ".join(quote(name) for name in robot.joints),
        n=len(robot.joints),
        body="\n".join(f"    {line}" for line in lines),
    )
    return write_text(path, text)


def _lines(function: Any, language: Language) -> Iterator[str]:
    """Yield one statement an operation; names are used once, so that all are constants."""
    ca = import_casadi()
    names = {getattr(ca, name): name for name in (*_BOTH, *_WORDS[language])}
    forms = _BOTH | _WORDS[language]
    end = ";" if language == "c" else ""
    held: dict[int, str] = {}
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        out, given = function.instruction_output(k), function.instruction_input(k)
        if kind == ca.OP_CONST:
            value = float(function.instruction_constant(k))
            held[out[0]] = repr(value) if value >= 0 else f"({value!r})"
        elif kind == ca.OP_INPUT:
            place = f"{given[1]}" if language == "c" else f"..., {given[1]}"
            held[out[0]] = f"{'qva'[given[0]]}[{place}]"
        elif kind == ca.OP_OUTPUT:
            place = f"{out[1]}" if language == "c" else f"..., {out[1]}"
            yield f"tau[{place}] = {held[given[0]]}{end}"
        else:
            name = f"x{k}"
            text = forms[names[kind]].format(*(held[g] for g in given))
            yield f"{'const double ' if language == 'c' else ''}{name} = {text}{end}"
            held[out[0]] = name
