"""The options that several commands have: each is declared once, in a group taken whole.

A command names a group as one parameter, ``place: Place``, and is made by `command`: groups become
its options, with help from docstrings.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import asdict, astuple, dataclass, fields, is_dataclass, make_dataclass
from functools import cache, partial, wraps
from inspect import Parameter, Signature, getdoc, signature
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from time import time
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_type_hints

import typer
from typer import Argument, Option

from identifiability.cli.common import Reads, Writes, look, sentences

if TYPE_CHECKING:
    from identifiability.foundation.engines.local import Engine
    from identifiability.foundation.result import Result
    from identifiability.logs.prepare import Preparation
    from identifiability.robot import Robot


# How groups of options become the options of a command, with help from docstrings.
#
# A command names a group as one parameter, ``place: Place``; `command` puts the group's options in
# its place.


#: Where a docstring begins to speak of parameters, and what it says of one.
_HELP = re.compile(r"\n*^(?:Parameters|Attributes)\n-+\n", re.MULTILINE)
_ENTRY = re.compile(r"^(\w+(?:, \w+)*)(?: : .*)?\n((?: {4}.*\n)+)", re.MULTILINE)


#: Options that take effects, and verbs in which an option of that name takes something else.
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate",)}


def split_names(_: str, text: str) -> list[str]:
    """Return the names in ``a,b c``."""
    return text.replace(",", " ").split()


def split_model(option: str, text: str) -> list[str] | str:
    """Return the effects in ``a,b``, or the path of a model file as it is."""
    return text if text.lower().endswith(".toml") else split_names(option, text)


def split_point(option: str, text: str) -> list[float]:
    """Return the numbers in ``x,y,z``.

    Raises
    ------
    OptionError
    """
    from identifiability.foundation.options import OptionError  # noqa: PLC0415

    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise OptionError(
            f"{option} {text} is no point; give three numbers, such as 0,0,0.08."
        ) from None


#: Options that had another name: verb and old name, and the new one.
RENAMED = {
    ("calibrate", "--trials"): "--replicates",
    ("prune", "--model"): "--out",
}


#: Options that went: verb and name, and what to type instead.
GONE = {
    ("diagnose", "--from"): "give all logs: identifiability diagnose ROBOT LOG LOG NEW_LOG",
}


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    from identifiability.robot import locate  # noqa: PLC0415

    return locate.shipped_robots()


#: What a help names, where it is written, and the pattern that finds it there: a help does not
#: wait the second that importing it takes.
_NAMED = {
    "estimation.estimate": ("estimation/least_squares.py", r'^    name: str = "(\w+)"'),
    "effects.registry": ("effects/*.py", r'^@declare\(.*?^    name = "(\w+)"'),
    "simulation.forces": ("simulation/forces.py", r'^(?:    |HIDDEN\w* = )"(\w+)"[:,\n]'),
}


def _named(home: str, registered: Callable[[Any], Iterable[str]]) -> list[str]:
    """Return the names that a module knows, if it is imported, as it is by a plugin, or holds."""
    module = sys.modules.get(f"identifiability.{home}")
    if module is not None:
        return list(registered(module))
    places, pattern = _NAMED[home]
    find = re.compile(pattern, re.MULTILINE | re.DOTALL)
    return [n for p in sorted(_ROOT.glob(places)) for n in find.findall(p.read_text("utf-8"))]


def estimators(typed: str = "") -> list[str]:
    """Return the registered estimators that begin so, a plugin's among them."""
    names = _named("estimation.estimate", lambda module: module.ESTIMATORS)
    return [name for name in names if name.startswith(typed)]


@dataclass(frozen=True)
class Parsed:
    """Marks an option whose text `read` turns into what the library takes, given its name first."""

    read: Callable[[str, str], Any]


def grouped(
    function: Callable[..., None],
    first: Callable[[dict[str, Any], dict[str, tuple[Any, ...]]], None] = lambda _given, _marks: (
        None
    ),
    library: str = "",
    but: Sequence[str] = (),
    spelt: Mapping[str, str] | None = None,
    more: Sequence[str] = (),
) -> Callable[..., None]:
    """Return the function as a command: groups become their options, with help from docstrings.

    `first` is called before it, with what was typed (groups and options by name) and with the
    marks that stand beside options in annotations, by name.

    An option of the command itself, or of the library, stands before one of a group with its name.
    What a docstring says of its parameters or attributes is the help of these options, and the rest
    of the function's is the help of the command.

    A command that takes ``**own`` has each option of the function of its name in the file `library`
    of the package (``file:name``, of another name), as that declares and explains it, `but` some
    and those that it has itself, which have the help of that function; some are `spelt` otherwise.
    Of other functions it has those that `more` names, ``file:name option option``.
    """
    library = library and f"{library}:{function.__name__}" if ":" not in library else library
    hints = get_type_hints(function)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    own = {option.name: option for option in _options(function, library)}
    takes = any(p.kind is p.VAR_KEYWORD for p in signature(function).parameters.values())
    declared = _declared(library, tuple((spelt or {}).items())) if takes else []
    for other, *names in map(str.split, more):
        declared = [*declared, *(o for o in _declared(other) if o.name in names)]
    taken = [o for o in declared if o.name not in {*own, *but}]
    usual = {o.name: o.default for o in taken}
    flat = [
        option
        for name in signature(function).parameters
        for option in (_options(groups[name]) if name in groups else filter(None, [own.get(name)]))
        if name not in groups or option.name not in {*own, *usual}
    ]

    holders = (function, *groups.values())
    marks = {name: found for holder in holders for name, found in _marks(holder).items()}
    marks |= {o.name: get_args(o.annotation)[2:] for o in taken}
    flat += [o.replace(default=None) if isinstance(o.default, tuple) else o for o in taken]

    @wraps(function)
    def called(**options: Any) -> None:
        whole = {
            name: kind(
                **{
                    f.name: options.pop(f.name)
                    for f in fields(kind)
                    if f.name not in {*own, *usual}
                }
            )
            for name, kind in groups.items()
        }
        first({**whole, **options}, marks)
        with sentences():
            options = _read_options(options, marks)
        left = {name: usual[name] for name in usual if options.get(name, "") is None}
        function(**whole, **{**options, **left})

    called.__doc__ = _HELP.split(getdoc(function) or "")[0]
    called.__signature__ = Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in flat}
    return called


def _read_options(
    options: Mapping[str, Any], marks: Mapping[str, tuple[Any, ...]]
) -> dict[str, Any]:
    """Return what was typed as the library takes it.

    Raises
    ------
    OptionError
        If a text is none of an option.
    """
    read = dict(options)
    for name, mark in ((n, m) for n in options for m in marks.get(n, ())):
        if isinstance(mark, Parsed) and read[name] is not None:
            read[name] = mark.read(f"--{name}", read[name])
    return read


@cache
def _options(holder: Any, library: str = "") -> list[Parameter]:
    """Return the parameters of a function or group as typer reads them, with help.

    What it does not say itself is that of a function of the library.
    """
    helps, kinds = _helps(getdoc(holder) or ""), get_type_hints(holder, include_extras=True)
    more = _helps(ast.get_docstring(_source(library)[1]) or "") if library else {}
    options = [
        _option(given, kinds[name], helps.get(name))
        for name, given in signature(holder).parameters.items()
        if given.kind is not Parameter.VAR_KEYWORD
    ]
    for option in options:
        if (note := next(iter(get_args(option.annotation)[1:]), None)) and not note.help:
            note.help = more.get(option.name)
    return options


def _option(given: Parameter, kind: Any, told: str | None) -> Parameter:
    """Return a parameter as typer reads it."""
    notes = getattr(kind, "__metadata__", ())
    if notes:
        kind, note = get_args(kind)[0], copy(notes[0])
    else:
        note = Argument() if given.default is given.empty else Option()
    note.help = told or note.help
    as_typer = Annotated[(kind, note, *notes[1:])]
    return given.replace(kind=Parameter.KEYWORD_ONLY, annotation=as_typer)


def _helps(told: str) -> dict[str, str]:
    """Return what a docstring says of each parameter or attribute, without its type."""
    texts = _ENTRY.findall(f"{_HELP.split(told)[-1]}\n")
    return {
        name: " ".join(text.split()).replace("``", "`")
        for names, text in texts
        for name in names.split(", ")
    }


#: The package.
_ROOT = Path(__file__).parents[1]

#: Arguments of the library that groups of options make.
_MADE = ("robot", "logs", "preparation")


@cache
def _source(library: str) -> tuple[ast.Module, ast.FunctionDef | ast.ClassDef]:
    """Return a file of the package and a function, or a class, of it: ``file:name``.

    It is not imported: a help does not wait a second for all that it needs.
    """
    file, _, name = library.partition(":")
    tree = ast.parse(_ROOT.joinpath(file).read_text("utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    return tree, next(n for n in tree.body if isinstance(n, kinds) and n.name == name)


@cache
def _declared(library: str, spelt: tuple[tuple[str, str], ...] = ()) -> list[Parameter]:
    """Return the options of a function, or of a class, of the library, read from its source."""
    if not library:
        return []
    tree, found = _source(library)
    helps, options = _helps(ast.get_docstring(found) or ""), []
    for name, annotation, default in _fields(found):
        text = ast.unparse(annotation)
        if name in _MADE:
            continue
        if (kind := _kind(text, tree)) is not None:
            told = helps.get(name)
            if kind == list[str] | None:
                told = f"{told} May be given several times."
            given = Parameter(name, Parameter.KEYWORD_ONLY, default=_usual(default, tree))
            if name in dict(spelt):
                kind, *notes = get_args(kind) if hasattr(kind, "__metadata__") else (kind, Option())
                notes[0].param_decls = (dict(spelt)[name],)
                kind = Annotated[(kind, *notes)]
            options.append(_option(given, kind, None if kind is Seed else told))
    return options


def _usual(default: ast.expr | None, tree: ast.Module) -> Any:
    """Return the value of a default; where it is required the sign of that."""
    if isinstance(default, ast.Name):
        default = ast.parse(_assigned(default.id, tree) or "None", mode="eval").body
    return Parameter.empty if default is None else ast.literal_eval(default)


def _fields(
    found: ast.FunctionDef | ast.ClassDef,
) -> Iterator[tuple[str, ast.expr, ast.expr | None]]:
    """Yield name, annotation and default of fields that have one, and of all arguments."""
    if isinstance(found, ast.ClassDef):
        for n in found.body:
            if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name) and n.value:
                yield n.target.id, n.annotation, n.value
        return
    given = found.args
    required = [None] * (len(given.args) - len(given.defaults))
    defaults = [*required, *given.defaults, *given.kw_defaults]
    for argument, default in zip([*given.args, *given.kwonlyargs], defaults, strict=True):
        if argument.annotation is not None:
            yield argument.arg, argument.annotation, default


#: Ranges that annotations state, as `foundation.options` makes them.
_RANGE = re.compile(
    r"Annotated\[(int|float), (?:at_least|counted|within)\(([^,)]+)(?:, ([^,)]+))?\)\]"
)


def _kind(text: str, tree: ast.Module) -> Any:
    """Return what an annotation of the library is on a command line; None if nothing."""
    if text in KINDS:
        return KINDS[text]

    def value(name: str) -> str:
        return _assigned(name, tree) or _imported(name, tree) or name

    kind: Any = None
    plain, note = value(text.removesuffix(" | None")), Option()
    if plain.startswith("Literal["):
        kind = Literal[tuple(ast.literal_eval(plain.removeprefix("Literal")))]
    elif found := _RANGE.fullmatch(plain):
        number = {"int": int, "float": float}[found[1]]
        ends = [None if end is None else number(value(end)) for end in found.groups()[1:]]
        kind, note.min, note.max = number, *ends
    return kind and Annotated[(kind | None if text.endswith(" | None") else kind, note)]


def _assigned(name: str, tree: ast.Module) -> str | None:
    """Return what a module assigns to a name, by itself or beside others."""
    for n in tree.body:
        if isinstance(n, ast.Assign):
            target = n.targets[0]
            pairs = (
                zip(target.elts, n.value.elts, strict=False)
                if isinstance(target, ast.Tuple) and isinstance(n.value, ast.Tuple)
                else [(target, n.value)]
            )
            for to, value in pairs:
                if isinstance(to, ast.Name) and to.id == name:
                    return ast.unparse(value)
    return None


def _imported(name: str, tree: ast.Module) -> str | None:
    """Return what the module that a name is imported from assigns to it."""
    for n in tree.body:
        if isinstance(n, ast.ImportFrom) and n.module and name in [a.name for a in n.names]:
            place = _ROOT.joinpath(*n.module.split(".")[1:]).with_suffix(".py")
            if n.module.startswith("identifiability.") and place.exists():  # without a tree of it
                pattern = rf"^{name} = (.+?)\n(?![ \])])"
                found = re.search(pattern, place.read_text("utf-8"), re.MULTILINE | re.DOTALL)
                return found and " ".join(found[1].split())
    return None


@cache
def _marks(holder: Any) -> dict[str, tuple[Any, ...]]:
    """Return what stands beside the options of a function or group in their annotations."""
    hints = get_type_hints(holder, include_extras=True)
    kinds = {name: getattr(kind, "__metadata__", ())[1:] for name, kind in hints.items()}
    return {name: found for name, found in kinds.items() if found}


def effects(option: str) -> list[str]:
    """Return the effects that an option takes, a plugin's among them."""
    if option == "hide":
        registry = sys.modules.get("identifiability.effects.registry")
        own = () if registry is None else registry.effect_laws()
        return [*_named("simulation.forces", lambda module: module.hideable()), *own]
    return _named("effects.registry", lambda module: module.FAMILIES)


class Command(typer.core.TyperCommand):
    """A command whose help lists what there is when it is asked for, and that knows old options."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        takes, robots = "", ""
        for parameter in self.params:
            name = str(parameter.name)
            if name == "method":
                parameter.metavar = "|".join(estimators())
            if name in TAKES_EFFECTS and str(self.name) not in TAKES_EFFECTS[name]:
                takes = f"**Effects**: {', '.join(effects(name))}"
            if name == "robot":
                robots = f"**Shipped robots**: {', '.join(shipped_robots())}"
        self.epilog = "\n\n".join(filter(None, (robots, takes))) or None
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse an option that has another name now, with that name."""
        for given in args[: args.index("--")] if "--" in args else args:
            option = given.partition("=")[0]
            new = RENAMED.get((str(self.name), option))
            if new is not None:
                ctx.fail(f"{option} is called {new} now.")
            instead = GONE.get((str(self.name), option))
            if instead is not None:
                ctx.fail(f"{option} is gone; {instead}.")
        return super().parse_args(ctx, args)


# The options that several commands have: each is declared once, in a group that is taken whole.
#
# A command names a group as one parameter, ``place: Place``, and is made by `command`.


def _robots(typed: str) -> list[str]:
    """Return the shipped robots that begin so, for the shell; it adds the files itself."""
    package = Path(__file__).resolve().parents[1]
    shipped = [*package.glob("models/*/robot.*"), *package.parent.glob("models/*/robot.*")]
    return sorted({p.parent.name for p in shipped if p.parent.name.startswith(typed)})


def _load_plugins(context: typer.Context, paths: list[Path] | None) -> list[Path]:
    """Register what the user's files add before the command, or its help, asks for any."""
    if paths and not context.resilient_parsing:
        from identifiability.effects import load_plugin  # noqa: PLC0415

        with sentences():
            for path in paths:
                load_plugin(path)
    return paths or []


Logs = Annotated[
    list[str],
    Argument(
        help="Logs to fit: CSV or Parquet with `t`, `<joint>.q`, `<joint>.tau` and, if measured, "
        "`<joint>.dq`, `<joint>.ddq`, or commanded, `<joint>.q_ref`, in SI units; arrays of these "
        "in .npz or .mat, sheets in .xlsx; or bags of ROS, as `run.mcap:/joint_states`."
    ),
]
_LADDER = "TOML ladder of models; default: the one beside the robot."
_MODEL = "Effects of the model, such as rigid_body,viscous_friction, or a model file (.toml)."
Ladder = Annotated[str | None, Option(help=_LADDER), Reads("ladder", "TOML")]
#: What analyze, prune and diagnose write.
RESULT = Reads("result", "JSON")
JsonResult = Annotated[Path, Argument(help="JSON that analyze, prune or diagnose wrote."), RESULT]
#: Logs that are not fitted as those of `analyze` are: the library says what they are.
OtherLogs = Annotated[list[str], Argument()]
Report = Annotated[Path | None, Option(), Writes(".html", ".htm")]
Seed = Annotated[int, Option(min=0, help="Seed of every random choice.")]
#: What an annotation of the library is on a command line, beside choices and ranges, which say it
#: themselves; a verb has options of other kinds itself.
KINDS: dict[str, Any] = {
    "bool": bool,
    "int": int,
    "str | None": str | None,
    "Method": Annotated[str, Option(metavar="NAME", autocompletion=estimators)],
    "Positive": Annotated[float, Option(min=0)],
    **dict.fromkeys(
        ("Positive | None", "NotNegative | None"), Annotated[float | None, Option(min=0)]
    ),
    "Effects | None": Annotated[str | None, Option(), Parsed(split_names)],
    "Seed": Seed,
    "FilePath | None": Path | None,
    "Replicates | None": Annotated[int | None, Option(min=0)],
    **dict.fromkeys(("Logs", "Logs | None", "Names", "Names | None"), list[str] | None),
    "LadderLike | None": Ladder,
    "ModelLike | None": Annotated[
        str | None,
        Option(help=_MODEL),
        Reads("model", "TOML", always=False),
        Parsed(split_model),
    ],
    "LimitsLike | None": Annotated[Path | None, Option(), Reads("limits", "TOML")],
    "Before | None": Annotated[Path | None, Option(), RESULT],
    "Other | None": Annotated[str | None, Option(metavar="ROBOT|RESULT")],
    "NoiseLike | None": Annotated[str | None, Option(metavar="LEVELS")],
    "Point": Annotated[str | None, Option(metavar="X,Y,Z"), Parsed(split_point)],
}


@dataclass(frozen=True)
class Machine:
    """The robot, and what its file does not say.

    Attributes
    ----------
    robot
        MJCF or URDF file, or a shipped robot such as 3-rps.
    sidecar
        TOML with what the robot file cannot say.
    lock
        Joint that does not move, such as a gripper's, at home or at a position [rad or m]; may be
        given several times.
    base
        Whether the root stood still while logs were measured, as on a stand (fixed), or not
        (floating).
    plugin
        Python file that registers effects of your own; may be given several times.
    """

    robot: Annotated[str, Argument(autocompletion=_robots)]
    sidecar: str | None = None
    lock: Annotated[list[str] | None, Option(metavar="NAME[=VALUE]")] = None
    base: Annotated[str | None, Option(metavar="fixed|floating")] = None
    plugin: Annotated[list[Path] | None, Option(callback=_load_plugins, is_eager=True)] = None

    def load(self, recorded: Recorded | None = None) -> Robot:
        """Return the robot, with what was said of its logs."""
        from identifiability.robot import Robot  # noqa: PLC0415

        said = recorded or Recorded()
        columns, unit, angles = said.columns, said.time_unit, said.angles
        base: Any = self.base
        return Robot.load(self.robot, self.sidecar, columns, self.lock, unit, angles, base)


@dataclass(frozen=True)
class Recorded:
    r"""What logs of the robot call things.

    Attributes
    ----------
    map
        Name in the logs and name in the robot file, of a column or of a joint: OLD=NEW, also
        by a regular expression, as in 'fer_joint(\d)=panda_joint\1'; may be given several times.
    time_unit
        Unit of the times in the logs, where they do not tell it themselves.
    angles
        Unit of their angles, and of angular rates; by default rad, and what looks like degrees
        is refused.
    """

    map: Annotated[list[str] | None, Option(metavar="OLD=NEW")] = None
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    angles: Literal["rad", "deg"] | None = None

    @property
    def columns(self) -> dict[str, str]:
        """From names in the logs to names in the robot file.

        Raises
        ------
        OptionError
            If one is no pair of names.
        """
        from identifiability.foundation.options import OptionError  # noqa: PLC0415

        rules: dict[str, str] = {}
        for given in self.map or ():
            old, equals, new = given.rpartition("=")
            if not (old and equals and new):
                raise OptionError(
                    f"--map {given} is no pair of names; give OLD=NEW, such as --map "
                    "'fer_joint1=panda_joint1'."
                )
            if rules.setdefault(old, new) != new:
                raise OptionError(f"--map gives '{old}' two names, {rules[old]} and {new}.")
        return rules


@dataclass(frozen=True)
class Outputs:
    """Where results are written.

    Attributes
    ----------
    report
        Write an HTML report here.
    json
        Write the result as JSON here.
    """

    report: Report = None
    json: Annotated[Path | None, Option(), Writes(".json")] = None

    def write(
        self,
        result: Result,
        say: Callable[[str, float], None],
        *first: tuple[Callable[[Path], Path], Path | None],
    ) -> list[Path]:
        """Write what was asked for, `first` by its own functions, and return the paths.

        Raises
        ------
        OutputError
            If something cannot be written where it should; it is then elsewhere, and that is said.
        """

        def draw(path: Path) -> Path:
            say("drawing the report", 0.95)
            return result.write_report(path)

        return write_all(*first, (result.to_json, self.json), (draw, self.report))


def write_all(*asked: tuple[Callable[[Path], Path], Path | None]) -> list[Path]:
    """Call functions that write with their paths, and return these; those of no path are not asked.

    Raises
    ------
    OutputError
        As `Outputs.write`, after all others were written.
    """
    from identifiability.foundation.errors import OutputError  # noqa: PLC0415

    written, failed = [], []
    for write, path in asked:
        if path is not None:
            try:
                written.append(_write(write, path))
            except OutputError as error:
                failed.append(str(error))
    if failed:
        raise OutputError(" ".join(failed))
    return written


#: Folders of results whose own place was full, and for how many days they stay.
RESCUED, RESCUED_FOR = "identifiability-rescued-", 30


def _write(write: Callable[[Path], Path], path: Path) -> Path:
    """Write a result; where that fails, as on a full disk, write it elsewhere and say where."""
    from identifiability.foundation.errors import OutputError  # noqa: PLC0415

    try:
        return write(path)
    except OutputError as error:
        for old in Path(gettempdir()).glob(f"{RESCUED}*"):
            if time() - old.stat().st_mtime > RESCUED_FOR * 86400:
                rmtree(old, ignore_errors=True)
        elsewhere = Path(mkdtemp(prefix=RESCUED)) / path.name
        try:
            write(elsewhere)
        except BaseException as again:  # also Ctrl-C
            rmtree(elsewhere.parent, ignore_errors=True)
            if isinstance(again, OutputError):
                raise error from None
            raise
        raise OutputError(
            f"{error} What was found is not lost: it is in '{elsewhere}', for {RESCUED_FOR} days."
        ) from None


def _grouped_by(library: str, panel: str, but: Sequence[str] = ()) -> Any:
    """Return the group of options of a function, or class, of the library: ``file:name``."""
    taken = [option for option in _declared(library) if option.name not in but]
    for option in taken:
        get_args(option.annotation)[1].rich_help_panel = panel
    listed = [(o.name, o.annotation, o.default) for o in taken]
    return make_dataclass(library.rpartition(":")[2], listed, frozen=True)


_PREPARATION = "logs/prepare/preparation.py:Preparation"
_Derived: Any = _grouped_by(_PREPARATION, "Velocity and acceleration", ("outputs", "keep_rest"))


class Derived(_Derived):  # type: ignore[misc]
    """How logs become motion."""

    def preparation(self) -> Preparation | None:
        """Return what was asked for; None if nothing was."""
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415

        return None if self == type(self)() else Preparation(**asdict(self))


_Place: Any = _grouped_by("foundation/engines/local.py:choose_engine", "Where it runs")


class Place(_Place):  # type: ignore[misc]
    """Where long work runs."""

    def stated(self, engine: Engine) -> Engine | None:
        """Return the engine if anything was said of it; a verb left to itself ends it sooner."""
        return engine if any(astuple(self)) else None

    @contextmanager
    def running(self) -> Iterator[Engine]:
        """Give the engine; its processes end with it. Say if there was nothing to keep."""
        from identifiability.foundation.engines.local import Resumed, choose_engine  # noqa: PLC0415

        with choose_engine(*astuple(self)) as engine:
            yield engine
        if isinstance(engine, Resumed) and not engine.found + engine.done:
            typer.echo(
                f"--resume kept nothing in '{self.resume}': this was done in one piece, without "
                "parts that could be; the same command begins anew.",
                err=True,
            )


@dataclass(frozen=True)
class Verb:
    """A command that is made when it is typed: eighteen of them take longer than a help may."""

    function: Callable[..., None]
    make: Callable[[Callable[..., None]], Callable[..., None]]

    @property
    def help(self) -> str:
        """What it says of itself."""
        return _HELP.split(getdoc(self.function) or "")[0]

    def made(self, name: str) -> Any:
        """Return it with its options, as typer has it."""
        alone = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        alone.command(name, cls=Command)(self.make(self.function))
        return typer.main.get_command(alone)


def command(
    library: str = "",
    *more: str,
    but: Sequence[str] = (),
    motion_alone: bool = False,
    **spelt: str,
) -> Callable[[Callable[..., None]], Verb]:
    """Make a function a command, as by `grouped`; files are looked at first.

    Parameters
    ----------
    library, more, but, spelt
        As for `grouped`.
    motion_alone
        Whether it takes logs without torque.
    """
    looked = partial(look, motion_alone=motion_alone)
    make = partial(grouped, first=looked, library=library, but=but, spelt=spelt, more=more)
    return partial(Verb, make=make)
