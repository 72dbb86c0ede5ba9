"""What others build on: names, signatures, commands, options and JSON keys, pinned line by line.

`public_api.txt` is the pin. Who changes the interface on purpose writes it anew with
``python tests/test_public_api.py`` and sees the change as a difference of lines.
"""

import ast
import inspect as reflection
import sys
from dataclasses import replace
from pathlib import Path

import typer
from numpy.random import default_rng

import identifiability
from identifiability import (
    Robot,
    analyze,
    calibrate,
    compare,
    diagnose,
    inspect,
    payload,
    prune,
    simulate,
)
from identifiability.cli import app
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, shipped_trajectory

PIN = Path(__file__).with_name("public_api.txt")

#: Objects whose keys are names from the user's files.
BY_NAME = {
    "groupings",
    "preparation",
    "provenance",
    "survives",
    "rms",
    "tie",
    "hold",
}


def python_lines():
    """One line a public name: its signature, for a class also its public members."""
    for name in sorted(identifiability.__all__):
        value = getattr(identifiability, name)
        if reflection.isclass(value):
            yield f"python {name}"
            ours = [c for c in value.__mro__ if c.__module__.startswith("identifiability")]
            for member in sorted({m for c in ours for m in vars(c)}):
                if not member.startswith("_"):
                    given = getattr(value, member)
                    yield f"python {name}.{member}{_parameters(given)}"
            for member in sorted(getattr(value, "__dataclass_fields__", {})):
                yield f"python {name}.{member}"
        else:
            yield f"python {name}{_parameters(value)}"


def _parameters(value):
    """Names, kinds and whether there is a default; types are mypy's business."""
    if not callable(value):
        return ""
    bare = [
        p.replace(annotation=p.empty, default=p.empty if p.default is p.empty else ...)
        for p in reflection.signature(value).parameters.values()
    ]
    return str(reflection.Signature(bare)).replace("Ellipsis", "…")


def command_lines():
    """One line a command, argument and option."""
    for name, command in sorted(vars(typer.main.get_command(app))["commands"].items()):
        yield f"command {name}"
        for parameter in command.params:
            names = "/".join([*parameter.opts, *parameter.secondary_opts])
            shown = names if parameter.param_type_name == "option" else names.upper()
            many = " …" if getattr(parameter, "multiple", False) or parameter.nargs == -1 else ""
            must = " (required)" if parameter.required else ""
            yield f"command {name} {shown}{many}{must}"


def json_lines():
    """One line a key of every kind of result."""
    robot = Robot.load("two-link")
    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), 400)
    log = simulate(robot, motion, noise=PAPER_NOISE, rng=default_rng(0))
    other = simulate(robot, motion, noise=PAPER_NOISE, rng=default_rng(1))
    analysis = _trusted(analyze(robot, log, replicates=0, posterior=True))
    results = [
        analysis,
        calibrate(analysis, replicates=16, refits=20),
        prune(robot, log, replicates=4),
        inspect(robot, log),
        payload(robot, analysis, other),
        compare(robot, log, other),
        diagnose(robot, log, quick=True),
    ]
    for result in results:
        content = result.to_dict()
        schema = content["schema"]
        yield from sorted({f"json {schema} {key}" for key in _keys(content)})


def _trusted(analysis):
    """Posteriors that have converged, whose numbers are not withheld."""

    def trust(summary):
        return replace(summary, convergence=replace(summary.convergence, reasons=()))

    belief = analysis.belief
    belief = replace(belief, physical=trust(belief.physical))
    return replace(analysis, belief=belief)


def _keys(value, path=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            by_name = path.rpartition(".")[2] in BY_NAME or path == "physical.parameters"
            here = f"{path}.{'*' if by_name else key}".lstrip(".")
            yield here
            yield from _keys(inner, here)
    elif isinstance(value, (list, tuple)) and any(isinstance(v, dict) for v in value):
        for inner in value:
            yield from _keys(inner, f"{path}[]")


def lines():
    return [*dict.fromkeys([*python_lines(), *command_lines(), *json_lines()])]


def test_the_public_interface_is_the_pinned_one():
    pinned = PIN.read_text().splitlines()
    found = lines()
    gone = [line for line in pinned if line not in found]
    new = [line for line in found if line not in pinned]
    assert not gone, f"these are gone; if that is meant, run python {Path(__file__).name}"
    assert not new, f"these are new; pin them with python {Path(__file__).name}"


def test_every_public_name_is_listed_where_one_looks():
    assert dir(identifiability) == sorted(identifiability.__all__)
    assert set(identifiability._HOMES) == set(identifiability.__all__) - {"__version__"}
    for name in identifiability.__all__:
        assert name == "__version__" or getattr(identifiability, name).__doc__, name


#: Functions that write results as JSON.
WRITERS = ("to_dict", "to_row", "row", "identity")


def constant_keys(source):
    """One entry a JSON key that always has the same empty value."""
    functions = (f for f in ast.walk(ast.parse(source)) if isinstance(f, ast.FunctionDef))
    for function in functions:
        if function.name not in WRITERS and not function.name.endswith(("_row", "_dict")):
            continue
        for node in ast.walk(function):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "dict.fromkeys":
                yield f"{function.name}: {ast.unparse(node)}"
            if isinstance(node, ast.Dict):
                yield from (
                    f"{function.name}: {ast.unparse(key)}"
                    for key, value in zip(node.keys, node.values, strict=True)
                    if key is not None and ast.unparse(value) in ("None", "[]", "{}", "()", "''")
                )


def test_no_result_writes_a_key_that_is_always_empty():
    planted = "def to_dict(self):\n return {'old': None, **dict.fromkeys(('a',))} | {'b': []}"
    assert len([*constant_keys(planted)]) == 3
    package = Path(identifiability.__file__).parent
    found = {path: [*constant_keys(path.read_text())] for path in package.rglob("*.py")}
    assert not {path: keys for path, keys in found.items() if keys}


if __name__ == "__main__":
    PIN.write_text("\n".join(lines()) + "\n", encoding="utf-8")
    sys.stdout.write(f"{PIN}\n")
