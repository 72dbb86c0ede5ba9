"""The options that several commands have: each is declared once, in a group taken whole.

A command names a group as one parameter, ``place: Place``, and is made by `command`: groups become
its options, with help from docstrings.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import asdict, astuple, dataclass, fields, is_dataclass, make_dataclass
from functools import cache, partial, wraps
from inspect import Parameter, Signature, getdoc, signature
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
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
_ENTRY = re.compile(r"^(\w+)(?: : .*)?\n((?: {4}.*\n)+)", re.MULTILINE)


#: Options that take effects, and verbs in which an option of that name takes something else.
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate",)}


#: Options that had another name: verb and old name, and the new one.
RENAMED = {
    ("calibrate", "--trials"): "--replicates",
    ("prune", "--model"): "--out",
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


def grouped(
    function: Callable[..., None],
    first: Callable[[dict[str, Any], dict[str, tuple[Any, ...]]], None] = lambda _given, _marks: (
        None
    ),
    library: str = "",
    but: Sequence[str] = (),
) -> Callable[..., None]:
    """Return the function as a command: groups become their options, with help from docstrings.

    `first` is called before it, with what was typed (groups and options by name) and with the
    marks that stand beside options in annotations, by name.

    An option of the command itself, or of the library, stands before one of a group with its name.
    What a docstring says of its parameters or attributes is the help of these options, and the rest
    of the function's is the help of the command.

    A command that takes ``**own`` has each option of the function of its name in the file `library`
    of the package, as that declares and explains it, `but` some and those that it has itself.
    """
    hints = get_type_hints(function)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    own = {option.name: option for option in _options(function)}
    declared = _declared(library, function.__name__)
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
    flat += [o.replace(default=o.default or None) if o.default == () else o for o in taken]

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
        for name in usual:
            if EFFECTS in marks[name]:
                options[name] = split_names(options[name])
            if any(isinstance(m, Reads) and m.what == "model" for m in marks[name]):
                options[name] = split_model(options[name])
        left = {name: usual[name] for name in usual if options[name] is None}
        function(**whole, **{**options, **left})

    called.__doc__ = _HELP.split(getdoc(function) or "")[0]
    called.__signature__ = Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in flat}
    return called


@cache
def _options(holder: Any) -> list[Parameter]:
    """Return the parameters of a function or group as typer reads them, with help."""
    helps, kinds = _helps(getdoc(holder) or ""), get_type_hints(holder, include_extras=True)
    return [
        _option(given, kinds[name], helps.get(name))
        for name, given in signature(holder).parameters.items()
        if given.kind is not Parameter.VAR_KEYWORD
    ]


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
    return {name: " ".join(text.split()).replace("``", "`") for name, text in texts}


#: The package.
_ROOT = Path(__file__).parents[1]

#: Arguments of the library that groups of options make.
_MADE = ("robot", "logs", "preparation")


@cache
def _declared(library: str, verb: str) -> list[Parameter]:
    """Return the options of a function, or of a class, of the library, read from its source.

    It is not imported: a help does not wait a second for all that it needs.
    """
    if not library:
        return []
    tree = ast.parse(_ROOT.joinpath(library).read_text("utf-8"))
    kinds = (ast.FunctionDef, ast.ClassDef)
    found = next(n for n in tree.body if isinstance(n, kinds) and n.name == verb)
    helps = _helps(ast.get_docstring(found) or "")
    options = []
    for name, annotation, default in _fields(found):
        kind = _kind(ast.unparse(annotation), tree)
        if kind is None or name in _MADE:
            continue
        if isinstance(default, ast.Name):
            text = _assigned(default.id, tree) or "None"
            default = ast.parse(text, mode="eval").body  # noqa: PLW2901
        told = None if kind is Seed else helps.get(name)
        if kind == list[str] | None:
            told = f"{told} May be given several times."
        usual = ast.literal_eval(default)
        options.append(_option(Parameter(name, Parameter.KEYWORD_ONLY, default=usual), kind, told))
    return options


def _fields(found: ast.FunctionDef | ast.ClassDef) -> Iterator[tuple[str, ast.expr, ast.expr]]:
    """Yield name, annotation and default of what has both."""
    if isinstance(found, ast.ClassDef):
        for n in found.body:
            if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name) and n.value:
                yield n.target.id, n.annotation, n.value
        return
    given = found.args
    defaults = [*given.defaults, *given.kw_defaults]
    arguments = [*given.args, *given.kwonlyargs][-len(defaults) :]
    for argument, default in zip(arguments, defaults, strict=True):
        if argument.annotation is not None and default is not None:
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
            new = RENAMED.get((str(self.name), given.partition("=")[0]))
            if new is not None:
                ctx.fail(f"{given.partition('=')[0]} is called {new} now.")
        return super().parse_args(ctx, args)


# The options that several commands have: each is declared once, in a group that is taken whole.
#
# A command names a group as one parameter, ``place: Place``, and is made by `command`.


_placed = partial(Option, rich_help_panel="Where it runs")


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
Model = Annotated[str | None, Option(help=_MODEL), Reads("model", "TOML", always=False)]
Limits = Annotated[Path | None, Option(), Reads("limits", "TOML")]
#: What analyze, prune and diagnose write.
JsonResult = Annotated[Path, Argument(), Reads("result", "JSON")]
Report = Annotated[Path | None, Option(), Writes(".html", ".htm")]
#: How often what judges an answer is repeated; each verb says of what.
Replicates = Annotated[int | None, Option(min=0)]
Seed = Annotated[int, Option(min=0, help="Seed of every random choice.")]
#: Beside an option that takes effects as ``a,b``.
EFFECTS = "effects"
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
    "Effects | None": Annotated[str | None, Option(), EFFECTS],
    "Seed": Seed,
    "Replicates | None": Replicates,
    **dict.fromkeys(("Logs", "Logs | None", "Names", "Names | None"), list[str] | None),
    "LadderLike | None": Ladder,
    "ModelLike | None": Model,
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

    def write(self, result: Result, say: Callable[[str, float], None]) -> list[Path]:
        """Write what was asked for and return the paths, the report last.

        Raises
        ------
        OutputError
            If something cannot be written where it should; it is then elsewhere, and that is said.
        """
        written = [_write(result.to_json, self.json)] if self.json else []
        if self.report is not None:
            say("drawing the report", 0.95)
            written.append(_write(result.write_report, self.report))
        return written


def _write(write: Callable[[Path], Path], path: Path) -> Path:
    """Write a result; where that fails, as on a full disk, write it elsewhere and say where."""
    from identifiability.foundation.errors import OutputError  # noqa: PLC0415

    try:
        return write(path)
    except OutputError as error:
        elsewhere = Path(mkdtemp(prefix="identifiability-")) / path.name
        try:
            write(elsewhere)
        except BaseException as again:  # also Ctrl-C
            rmtree(elsewhere.parent, ignore_errors=True)
            if isinstance(again, OutputError):
                raise error from None
            raise
        raise OutputError(f"{error} What was found is not lost: it is in '{elsewhere}'.") from None


def _grouped_by(library: str, name: str, panel: str, but: Sequence[str]) -> Any:
    """Return the group of what a class of the library holds, as that declares and explains it."""
    taken = [option for option in _declared(library, name) if option.name not in but]
    for option in taken:
        get_args(option.annotation)[1].rich_help_panel = panel
    return make_dataclass(name, [(o.name, o.annotation, o.default) for o in taken], frozen=True)


_PREPARATION = "logs/prepare/preparation.py", "Preparation"
_Derived: Any = _grouped_by(*_PREPARATION, "Velocity and acceleration", ("outputs", "keep_rest"))


class Derived(_Derived):  # type: ignore[misc]
    """How logs become motion."""

    def preparation(self) -> Preparation | None:
        """Return what was asked for; None if nothing was."""
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415

        return None if self == type(self)() else Preparation(**asdict(self))


@dataclass(frozen=True)
class Place:
    """Where long work runs.

    Attributes
    ----------
    engine
        In this process, in several, or on a Dask cluster; the result is the same. Default: in
        several once that is faster.
    workers
        Processes on this machine; default: one a core.
    scheduler
        Address of a running Dask scheduler, such as tcp://host:8786.
    resume
        Folder that keeps finished work; the same command takes it from there when it runs again.
    patience
        A scheduler that is asked and does not answer for so long is given up [s].
    """

    engine: Annotated[Literal["serial", "processes", "dask"] | None, _placed()] = None
    workers: Annotated[int | None, _placed(min=1)] = None
    scheduler: Annotated[str | None, _placed()] = None
    resume: Annotated[Path | None, _placed()] = None
    patience: Annotated[float, _placed(min=1)] = 60.0

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
    library: str = "", but: Sequence[str] = (), *, motion_alone: bool = False
) -> Callable[[Callable[..., None]], Verb]:
    """Make a function a command, as by `grouped`; files are looked at first.

    Parameters
    ----------
    library, but
        As for `grouped`.
    motion_alone
        Whether it takes logs without torque.
    """
    looked = partial(look, motion_alone=motion_alone)
    return partial(Verb, make=partial(grouped, first=looked, library=library, but=but))


def split_names(text: str | None) -> list[str] | None:
    """Return the names in ``a,b c``, or None."""
    return None if text is None else text.replace(",", " ").split()


def split_model(text: str | None) -> list[str] | str | None:
    """Return the effects in ``a,b``, or the path of a model file as it is."""
    return text if text is None or text.lower().endswith(".toml") else split_names(text)
