"""Statements of C and Python from a CasADi function, one an operation."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Literal

from identifiability.workflows.export.symbols import import_casadi

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
    held: dict[int, str] = {}
    for k in range(function.n_instructions()):
        kind = function.instruction_id(k)
        out, given = function.instruction_output(k), function.instruction_input(k)
        name = f"x{k}"
        if kind == ca.OP_CONST:
            value = float(function.instruction_constant(k))
            held[out[0]] = repr(value) if value >= 0 else f"({value!r})"
        elif kind == ca.OP_INPUT:
            held[out[0]] = name
            yield f"{start}{name} = {inputs[given[0]]}{given_at[given[0]][given[1]]}{end}"
        elif kind == ca.OP_OUTPUT:
            yield f"{outputs[out[0]]}{found_at[out[0]][out[1]]} = {held[given[0]]}{end}"
        else:
            yield f"{start}{name} = {forms[names[kind]].format(*(held[g] for g in given))}{end}"
            held[out[0]] = name


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
