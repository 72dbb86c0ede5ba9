"""Write the reference pages that the code itself holds: `python docs/written.py [check]`.

Sidecars and ladders from the models that read them, effects and messages from their registries.
`make docs` writes them; a test says when a page is no longer what the code says.
"""

from __future__ import annotations

import inspect
import io
import runpy
import sys
import textwrap
import tomllib
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Union, get_args, get_origin

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from identifiability.effects import FAMILIES
from identifiability.effects.effect import AlongAxes, Family, measure_spans
from identifiability.foundation.documents import toml_text
from identifiability.foundation.findings import Finding, phrase, sentences
from identifiability.logs import names
from identifiability.quality.registry import CHECKS, Does
from identifiability.regression.reduction import LadderEntry
from identifiability.robot import Robot, complete_motion
from identifiability.robot.sidecar import Sidecar
from identifiability.workflows.case_file import CaseEntry

DOCS = Path(__file__).resolve().parent

#: Kinds of values, as a reader of TOML calls them.
WORDS = {str: "text", float: "number", int: "whole number", bool: "true or false"}

#: More curves in a picture are a net.
MOST_CURVES = 8


def tables(schema: type[BaseModel], at: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Yield every table of a document with its heading, the document itself first."""
    yield at, schema
    for name, field in schema.model_fields.items():
        for many, inner in _inner(field.annotation):
            path = f"{at}.{field.alias or name}".strip(".")
            yield from tables(inner, f"[{path}]" if many == "list" else path + many)


def _inner(annotation: Any, many: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield many, annotation
    nested = {list: "list", dict: ".NAME"}.get(get_origin(annotation), many)
    for part in get_args(annotation):
        yield from _inner(part, nested)


def kind_of(annotation: Any) -> str:
    """Return what a value is, in words."""
    origin, args = get_origin(annotation), get_args(annotation)
    if annotation in WORDS:
        return WORDS[annotation]
    if origin is list:
        return f"list of {kind_of(args[0])}"
    if origin is dict:
        return f"table of {kind_of(args[1])}"
    if origin is tuple:
        return f"[{', '.join(kind_of(a) for a in args)}]"
    if str(origin) == "typing.Literal":
        return " or ".join(f"`{a}`" for a in args)
    if hasattr(annotation, "__metadata__"):
        return kind_of(annotation.__origin__)
    if origin is Union or str(origin) == "<class 'types.UnionType'>":
        return " or ".join(dict.fromkeys(kind_of(a) for a in args if a is not type(None)))
    return "table" if inspect.isclass(annotation) else str(annotation)


def _cell(text: str) -> str:
    return " ".join(text.replace("``", "`").split()).replace("|", "\\|")


def rows_of(schema: type[BaseModel]) -> list[str]:
    """Return a table's keys as rows; those that are only tables have their own heading."""
    rows = []
    for name, field in schema.model_fields.items():
        if field.description is None and any(True for _ in _inner(field.annotation)):
            continue
        default = field.get_default(call_default_factory=True)
        said = "" if default in (None, PydanticUndefined, "", [], {}) else f"`{toml_of(default)}`"
        if default is PydanticUndefined:
            said = "must be given"
        assert field.description, f"{schema.__name__}.{name} does not say what it is"
        key = field.alias or name
        shown = [f"{key} = {toml_of(example)}" for example in field.examples or ()] or [key]
        cells = (f"`{shown[0]}`", kind_of(field.annotation), said)
        rows.append(f"| {' | '.join(_cell(c) for c in (*cells, field.description))} |")
    return rows


def toml_of(value: Any) -> str:
    """Return a value as it stands behind `=`."""
    if isinstance(value, dict):
        inner = ", ".join(
            f"{toml_text({k: v}).strip()}" if not isinstance(v, dict) else f"{k} = {toml_of(v)}"
            for k, v in value.items()
        )
        return f"{{{inner}}}"
    if isinstance(value, tuple):
        value = list(value)
    return toml_text({"x": value}).strip().removeprefix("x = ")


def write_schema(schema: type[BaseModel]) -> str:
    """Return every table of a document with its keys."""
    out = []
    for heading, table in tables(schema):
        rows = rows_of(table)
        if heading:
            said = inspect.getdoc(table) or ""
            out += [f"## `[{heading}]`", "", said.replace("``", "`"), ""]
        if rows:
            out += ["| key | value | default | meaning |", "|---|---|---|---|"]
            out += [*rows, ""]
    return "\n".join(out)


def _motion(robot: Robot) -> Any:
    t = np.linspace(0, 1, 400, endpoint=False)
    q = np.stack([0.9 * np.sin(2 * np.pi * t), 0 * t], axis=1)
    w = 2 * np.pi
    dq = np.stack([0.9 * w * np.cos(w * t), 0 * t], axis=1)
    return complete_motion(robot, t, q, dq, -(w**2) * q)


def picture_of(family: Family) -> str:
    """Return its curves at a joint as SVG: torque per unit over what they depend on, or nothing."""
    robot = Robot.load("two-link")
    motion = _motion(robot)
    joint = robot.joints[0]
    effect = family.effect
    over = {"velocity": motion.v[:, 0], "position": motion.q[:, 0], "time": motion.t}
    if not isinstance(effect, AlongAxes) or family.against not in over:
        return ""
    shapes = family.grid(measure_spans(robot, [motion])[joint])
    effect = family.at(shapes[len(shapes) // 2], joint)
    parameters = effect.parameters(robot)
    out = np.zeros((len(motion.t), len(robot.joints), len(parameters)))
    effect.fill(robot, motion, out)
    columns = [out[:, 0, k] for k, p in enumerate(parameters) if p.owner == joint]
    if len(columns) > MOST_CURVES or not any(np.ptp(c) > 0 for c in columns):
        return ""
    with mpl.rc_context({"svg.hashsalt": family.name, "svg.fonttype": "none", "font.size": 8}):
        figure = Figure(figsize=(2.6, 1.5), layout="constrained")
        axes = figure.add_subplot()
        for column in columns:
            axes.plot(over[family.against], column / (np.abs(column).max() or 1.0), lw=1.2)
        axes.set_xlabel(
            {"velocity": "speed", "position": "position", "time": "time"}[family.against]
        )
        axes.set_ylabel("torque")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[["top", "right"]].set_visible(False)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def write_effects() -> tuple[str, dict[str, str]]:
    """Return the page of all effects, and their pictures by file."""
    out, pictures = [], {}
    for family in FAMILIES.values():
        effect = family.effect
        out += [f"## {family.title[0].upper()}{family.title[1:]}", "", f"`{family.name}`", ""]
        if picture := picture_of(family):
            name = f"effect-{family.name}.svg"
            pictures[name] = picture
            out += [f"![{family.title} at a joint](../images/{name})", ""]
        if effect.equation:
            out.append(f"- Equation: {effect.equation}")
        if isinstance(effect, AlongAxes):
            kinds = ", ".join(f"`{k}` [{a} or {b}]" for k, a, b in effect.units)
            sign = "; never below zero" if effect.nonnegative else ""
            out.append(f"- Parameters of a joint that turns or slides: {kinds}{sign}")
        if family.needs:
            out.append(f"- Refines `{family.needs}`, which must be in the model at the same place")
        if family.shapes is not None:
            how = "continuously" if family.continuous else "on a grid"
            out.append(
                f"- `diagnose` searches its shape {how}; without a stated shape a model has a "
                "usual one"
            )
        if powers := effect.exponents:
            out.append(
                f"- It also searches the exponent δ, from {powers[0]:g} to {powers[-1]:g}. A model "
                f"states both, as in `{family.name}@joint_2:0.1,2`; without a stated δ it is 1"
            )
        if family.told_by:
            out.append(f"- How to separate it from similar effects: {family.told_by}")
        if effect.source:
            out.append(f"- Source: {effect.source}")
        out.append("")
    return "\n".join(out), pictures


def fill(key: str, value: Any) -> Any:
    """Return a value of an example, with parts of the sentence written out."""
    if isinstance(value, list):
        return [fill(key, item) for item in value]
    if isinstance(value, dict):
        numbers = {name: fill(key, item) for name, item in value.items()}
        said = phrase(key, numbers.pop("part"), **numbers)
        return f"{said}. {numbers['then']}." if "then" in numbers else said
    return value


def example_sentences(key: str) -> list[str]:
    """Return the sentences of a key, filled by the examples of ``message_examples.toml``."""
    examples = tomllib.loads((DOCS / "message_examples.toml").read_text(encoding="utf-8"))
    assert key in examples, f"docs/message_examples.toml has no example of '{key}'"
    out = []
    for example in examples[key]:
        numbers = {name: fill(key, value) for name, value in example.items()}
        out.append(str(Finding(key, numbers.pop("subject", ""), **numbers)))
    return out


def write_table_of_messages(keys: Sequence[str]) -> list[str]:
    """Return the lines of a table of messages, one row a key."""
    out, table = ["| check | it says | it means | what to do |", "|---|---|---|---|"], sentences()
    for key in keys:
        says = "<br>".join(example_sentences(key)).replace("<inertial>", "`<inertial>`")
        cells = (f"`{key}`", says, table[key]["means"], table[key]["do"])
        out.append(f"| {' | '.join(_cell(x) for x in cells)} |")
    return [*out, ""]


def write_messages() -> str:
    """Return the page of what data-quality checks say, by what follows from it."""
    follows = {
        Does.MENDS: "Data that are repaired",
        Does.MISREADS: "Columns with the wrong name, unit or sign",
        Does.EXPLAINS: "Causes of other contradictions",
        Does.HINTS: "Hints",
        Does.WEIGHS: "Rows with less weight in the fit",
    }
    out = []
    import_module("identifiability.workflows.case")  # whose checks need a fit
    for does, heading in follows.items():
        out += [f"## {heading}", ""]
        out += [f"{does[0].upper()}{does[1:]}.", ""] if does is not Does.HINTS else []
        out += write_table_of_messages([c.key for c in CHECKS if c.does is does])
    checks = {c.key for c in CHECKS}
    others = [key for key, own in sentences().items() if "level" in own and key not in checks]
    out += ["## Messages of reading, preparation and fit", "", *write_table_of_messages(others)]
    return "\n".join(out)


#: What the channels of the table of words are.
CHANNELS = {
    "t": "time",
    "q": "position",
    "dq": "velocity",
    "ddq": "acceleration",
    "tau": "torque or force",
    "current": "motor current, a torque by `[torque]` of the sidecar",
    "tau_ff": "torque that is fed forward",
    "wanted": "a command, with a word for the channel",
    "name": "text that says which joint a row is about",
    "silent": "says nothing",
    "estimated": "says nothing; a column without it goes first",
    "silent of commands": "says nothing of commands and currents",
}


def write_words() -> str:
    """Return the page of the words and units by which columns of logs are found."""
    out = ["| words | meaning of the column |", "|---|---|"]
    for channel, said in names.WORDS.items():
        told = CHANNELS.get(channel) or f"`{channel}` of a base that moves"
        out.append(f"| {' '.join(f'`{w}`' for w in said.split())} | {_cell(told)} |")
    out += ["", "## Units", "", "| written | of | one is, in SI |", "|---|---|---|"]
    out += [
        f"| {' '.join(f'`{w}`' for w in row.split())} | {unit} | {size:.9g} |"
        for unit, sizes in names.SIZES.items()
        for row, size in sizes.items()
    ]
    return "\n".join(out)


def write_studies() -> str:
    """Return one line a study, from the registry."""
    studies = runpy.run_path(str(DOCS.parent / "studies" / "registry.py"))["STUDIES"]
    rows = [
        f"| {', '.join(f'`{w}`' for w in (s.name, *s.words))} | {_cell(s.asks)} |" for s in studies
    ]
    return "\n".join(["| study | asks |", "|---|---|", *rows])


#: What stands at the head of each page; it is in lines as docstrings are.
NOTE = "<!-- Written by docs/written.py from the code: change that, not this page. -->\n"
SIDECAR = """# The sidecar

A TOML file with the robot file's name (`arm.toml` for `arm.urdf`, in one folder). It states facts
that the robot file cannot state. Every key may be left out.
"""
CASES = """# Studies in a folder

A folder with a `case.toml` is a case: a robot, its logs and settings. In the folder the verbs need
no arguments. `identifiability new` writes the file.

```toml
robot = "arm.urdf"
logs = ["run1.csv", "run2.csv"]
validate = ["run3.csv"]
masses = {forearm = [1.9, 2.1]}

[settings]
cutoff = 10
```

- `inspect` lists the robot, logs and settings of the case, and checks all logs.
- `analyze`, `prune` and `diagnose` fit the logs and verify on the held-out logs. `calibrate` fits
  the logs.
- `analyze` also writes the result. `predict` predicts the held-out logs from the result.
- `export` writes `fitted.xml` or `fitted.urdf`, and compares the file on the held-out logs.
- `compare` compares the logs with the held-out logs.
- `payload` estimates the load of the `loaded` logs from the result. The fitted logs have no load.
- `excite` finds the motion to measure next, and writes `next.json`. `simulate` follows it, or a
  random motion without it, and writes `simulated.csv`.

The next lines that verbs print leave out words that the case states.

From elsewhere, type the folder in place of the robot: `identifiability analyze study`. Logs that
are typed after the folder replace all logs of the case:
`identifiability predict . result.json run4.csv`. If the robot file of the case is typed, logs come
from the command line alone. Sidecar, locked joints, known masses and settings of the case still
hold.

An option on the command line goes before `case.toml`, and `case.toml` goes before the sidecar. In
Python, `Case.load("study")` reads the folder.
"""
LADDERS = """# Ladders of models

A TOML file with models that `analyze --ladder` and `prune --ladder` compare; `prune --out` and
`diagnose --out` write one.
"""
EFFECTS = """# Effects

Parts of a model, by the name that ladders, `--effects` and results use. A user's own effect is
one class in a file of its own (`--plugin`). Pictures: torque per unit of each parameter, at a
joint of an arm that swings.
"""
MESSAGES = """# Messages

`inspect` and every verb that reads logs print these messages where a log contradicts the robot
file, the limits or physics. Names and numbers here are examples. If two checks explain the same
rows, the first one in this order is printed. "It says" is the evidence, "it means" the usual cause.
Each check is one function under `@check`.
"""
LOG_WORDS = """# Words of logs

A column is `<joint>.<channel>`, or has the joint's name or number, one word for the channel, and
else only words that say nothing: `/joint_states/elbow/position`, `A1.Iststrom [A]`, `q_3`. Two
words may be written as one. For other names use `--map`, or `[columns]` of the sidecar.
Units stand in brackets behind a name, or in a row under the header; angles and lengths also by the
second (`deg/s`, `mm/s²`).
"""
STUDIES = """# Studies

A study in `studies/` measures a claim of this documentation, and writes a page and a JSON file to
`reports/`. From a checkout `identifiability paper NAME` or `python studies NAME`
runs it (`--quick`: in short); without a name those of the paper are run. The logs of real arms are
no part of this project: `$IDENTIFIABILITY_DATA` is their folder.
"""


def pages() -> dict[Path, str]:
    """Return every written page and picture, by its place."""
    effects, pictures = write_effects()
    reference = {
        "case": (CASES, _doc("identifiability.workflows.case_file"), write_schema(CaseEntry)),
        "sidecar": (SIDECAR, _doc("identifiability.robot.sidecar"), write_schema(Sidecar)),
        "ladders": (
            LADDERS,
            _doc("identifiability.regression.reduction"),
            write_schema(LadderEntry),
        ),
        "effects": (EFFECTS, effects),
        "messages": (MESSAGES, write_messages()),
        "log-words": (LOG_WORDS, write_words()),
        "studies": (STUDIES, write_studies()),
    }
    return {
        **{
            DOCS / "reference" / f"{name}.md": "\n".join((NOTE, *parts)).rstrip() + "\n"
            for name, parts in reference.items()
        },
        **{DOCS / "images" / name: text.rstrip() + "\n" for name, text in pictures.items()},
    }


def _doc(module: str) -> str:
    """Return what a module says of its files, without its first line and what it says of pages."""
    said = (inspect.getdoc(sys.modules[module]) or "").partition("\n\n")[2]
    sentences = " ".join(said.replace("``", "`").split()).split(". ")
    kept = ". ".join(s for s in sentences if "docs/reference" not in s).rstrip(".")
    return f"{textwrap.fill(kept, 98)}.\n"


def main() -> int:
    """Write the pages, or with `check` say which are not what the code says."""
    stale = []
    for path, text in pages().items():
        if not path.exists() or path.read_text() != text:
            # Pictures differ with the version of what draws them, and say the same.
            stale += [path.relative_to(DOCS.parent)] if path.suffix == ".md" else []
            if sys.argv[1:] != ["check"]:
                path.write_text(text)
    if stale and sys.argv[1:] == ["check"]:
        print(f"Not what the code says: {', '.join(map(str, stale))}; run make docs.")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
