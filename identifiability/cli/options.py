"""The options that several commands have: each is declared once, in a group taken whole.

A command names a group as one parameter, ``place: Place``, and is made by `command`: the fields of
the group become its options. What stands beside a kind in ``Annotated`` is what is known of an
option: typer's `Option` its spelling, `Expected` its range, which the API's functions share, and
`Reads`, `Writes` and `Parsed` what becomes of it. What it is says ``help.toml``.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import asdict, astuple, dataclass, is_dataclass
from functools import cache, partial
from inspect import Parameter, Signature, signature
from pathlib import Path
from shutil import rmtree
from tempfile import gettempdir, mkdtemp
from time import time
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import typer
from typer import Argument, Option
from typer.models import OptionInfo, ParameterInfo

from identifiability.cli.common import Reads, Writes, look, sentences
from identifiability.foundation.options import (
    Count,
    Derivatives,
    EngineName,
    EstimatorKind,
    Expected,
    NotNegative,
    OptionError,
    Positive,
    check_option,
)

if TYPE_CHECKING:
    from identifiability.foundation.engines.local import Engine
    from identifiability.foundation.result import Result
    from identifiability.logs.prepare import Preparation
    from identifiability.robot import Robot


# How groups of options become the options of a command.


#: Options that take effects, and verbs in which an option of that name takes something else.
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate",)}

#: Options that had another name: verb and old name, and the new one.
RENAMED = {
    ("calibrate", "--trials"): "--replicates",
    ("prune", "--model"): "--out",
}

#: Options that went: verb (none for all) and name, and what to type instead.
GONE = {
    ("excite", "--criterion"): "--parameter and --separate say what is asked: leave it out",
    ("excite", "--time-limit"): "a search ends by its motions: identifiability excite ROBOT "
    "--evaluations N --out FILE",
    ("prune", "--criterion"): "the smallest model that predicts as well is chosen: leave it out",
    ("prune", "--no-propose"): "symmetries of the robot are always tried: leave it out",
    ("prune", "--propose"): "symmetries of the robot are always tried: leave it out",
    ("prune", "--reach"): "it did nothing: leave it out",
    ("calibrate", "--no-sbc"): "the posterior is no longer checked: leave it out",
    ("calibrate", "--sbc"): "the posterior is no longer checked: leave it out",
    ("diagnose", "--replicates"): "log odds need no simulated noises: leave it out",
    ("", "--patience"): "a scheduler that is lost ends the work: leave it out",
    ("diagnose", "--from"): "give all logs: identifiability diagnose ROBOT LOG LOG NEW_LOG",
}


@cache
def helps() -> dict[str, Any]:
    """Return what the terminal says of each verb, and what there is without plugins."""
    return tomllib.loads(Path(__file__).with_name("help.toml").read_text("utf-8"))


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
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise OptionError(
            f"{option} {text} is no point; give three numbers, such as 0,0,0.08."
        ) from None


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    from identifiability.robot import locate  # noqa: PLC0415

    return locate.shipped_robots()


def estimators(typed: str = "") -> list[str]:
    """Return the registered estimators that begin so, a plugin's among them."""
    module = sys.modules.get("identifiability.estimation.estimate")
    names = helps()["methods"] if module is None else module.ESTIMATORS
    return [name for name in names if name.startswith(typed)]


def effects(option: str) -> list[str]:
    """Return the effects that an option takes, a plugin's among them."""
    registry = sys.modules.get("identifiability.effects.registry")
    if option == "hide":
        return [*helps()["hide"], *(() if registry is None else registry.effect_laws())]
    return list(helps()["effects"] if registry is None else registry.FAMILIES)


@dataclass(frozen=True)
class Parsed:
    """Marks an option whose text `read` turns into what the library takes, given its name first."""

    read: Callable[[str, str], Any]


@dataclass(frozen=True)
class Field:
    """An option: its name and default, its kind on the command line, and what is said beside it."""

    name: str
    kind: Any
    default: Any
    notes: Sequence[Any]

    @staticmethod
    def of(name: str, annotation: Any, default: Any) -> Field:
        """Return the option of a parameter, or of a field of a group."""
        kind, notes = _take_apart(annotation)
        return Field(name, list[str] if get_origin(kind) is Sequence else kind, default, notes)

    @property
    def spelling(self) -> str:
        """The option as it is typed."""
        spelt = [d for n in self.notes for d in getattr(n, "param_decls", None) or ()]
        return next(iter(spelt), f"--{self.name.replace('_', '-')}")

    def parameter(self, verb: str) -> Parameter:
        """Return it as typer reads it in a verb."""
        required = self.default is Parameter.empty
        infos = [copy(n) for n in self.notes if isinstance(n, ParameterInfo)]
        info = infos[0] if infos else Argument() if required else Option()
        said = helps()["options"]
        told = [said.get(verb, {}).get(self.name) or said["all"].get(self.name, "")]
        told += [f"({r.words})" for r in self._ranges()]
        if get_origin(self.kind) is list and isinstance(info, OptionInfo):
            told.append("May be given several times.")
        info.help = " ".join(told)
        default = None if self.default == () else self.default
        kind = self.kind | None if default is None else self.kind
        as_typer: Any = Annotated[kind, info]
        return Parameter(self.name, Parameter.KEYWORD_ONLY, default=default, annotation=as_typer)

    def read(self, typed: Any) -> Any:
        """Return what was typed as the library takes it.

        Raises
        ------
        OptionError
            If it is none of the option.
        """
        if typed is None:
            return self.default
        for rule in self._ranges():
            check_option(self.spelling, typed, Annotated[self.kind, rule])
        for mark in self.notes:
            if isinstance(mark, Parsed):
                typed = mark.read(self.spelling, typed)
        return typed

    def _ranges(self) -> list[Expected]:
        numbers = self.kind in (int, float)
        return [n for n in self.notes if numbers and isinstance(n, Expected)]


def _take_apart(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a kind without None, and all that stands beside it."""
    inner = get_args(annotation)
    if get_origin(annotation) is Annotated:
        kind, notes = _take_apart(inner[0])
        return kind, (*notes, *inner[1:])
    if get_origin(annotation) in (Union, UnionType):
        return _take_apart(next(kind for kind in inner if kind is not NoneType))
    return annotation, ()


def _fields(holder: Any) -> list[Field]:
    """Return the options of a function, or of a group."""
    kinds, given = get_type_hints(holder, include_extras=True), signature(holder).parameters
    return [Field.of(name, kinds[name], given[name].default) for name in given]


def grouped(function: Callable[..., None], *, motion_alone: bool = False) -> Callable[..., None]:
    """Return the function as typer reads it: groups become their options; files are looked at.

    Of two options of one name the last stands; the group of the other has its default.
    """
    own = {field.name: field for field in _fields(function)}
    groups: dict[str, Any] = {
        name: field.kind for name, field in own.items() if is_dataclass(field.kind)
    }
    owners: dict[str, str] = {}
    options: dict[str, Field] = {}
    for name, field in own.items():
        for option in _fields(groups[name]) if name in groups else (field,):
            owners[option.name] = name
            options.pop(option.name, None)
            options[option.name] = option

    marks = {name: option.notes for name, option in options.items()}

    def called(**typed: Any) -> None:
        with sentences():
            read = {name: option.read(typed[name]) for name, option in options.items()}
            given = {n: v for n, v in read.items() if owners[n] not in groups}
            for name, group in groups.items():
                given[name] = group(**{n: v for n, v in read.items() if owners[n] == name})
            machine, recorded = given.get("machine"), given.get("recorded")
            look(typed, marks, machine, recorded, motion_alone=motion_alone)
        function(**given)

    flat = [option.parameter(function.__name__) for option in options.values()]
    called.__signature__ = Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {p.name: p.annotation for p in flat}
    return called


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
            instead = GONE.get((str(self.name), option)) or GONE.get(("", option))
            if instead is not None:
                ctx.fail(f"{option} is gone; {instead}.")
        return super().parse_args(ctx, args)


# The options that several commands have: each is declared once, in a group that is taken whole.
#
# A command names a group as one parameter, ``place: Place``, and is made by `command`.


@dataclass(frozen=True)
class Verb:
    """A command that is made when it is typed: eighteen of them take longer than a help may."""

    function: Callable[..., None]
    motion_alone: bool = False

    def made(self, name: str) -> Any:
        """Return it with its options, as typer has it."""
        alone = typer.Typer(add_completion=False, rich_markup_mode="markdown")
        run = grouped(self.function, motion_alone=self.motion_alone)
        alone.command(name, cls=Command, help=helps()["verbs"].get(name))(run)
        return typer.main.get_command(alone)


def command(*, motion_alone: bool = False) -> Callable[[Callable[..., None]], Verb]:
    """Make a function a command, of logs without torque too where they are of `motion_alone`."""
    return partial(Verb, motion_alone=motion_alone)


# Kinds of options, and groups of them.


def find_robots(typed: str) -> list[str]:
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


Logs = list[str]
#: What analyze, prune and diagnose write.
RESULT = Reads("result", "JSON")
JsonResult = Annotated[Path, RESULT]
Report = Annotated[Path | None, Writes(".html", ".htm")]
Table = Writes(".csv", ".parquet", ".pq")
Effects = Annotated[str | None, Parsed(split_names)]
Ladder = Annotated[str | None, Reads("ladder", "TOML")]
Limits = Annotated[Path | None, Reads("limits", "TOML")]
Method = Annotated[str, Option(metavar="NAME", autocompletion=estimators)]
Model = Annotated[str | None, Reads("model", "TOML", always=False), Parsed(split_model)]
Estimator = EstimatorKind
Prior = NotNegative | None
Point = Annotated[str, Option(metavar="X,Y,Z"), Parsed(split_point)]
Quick = bool


@dataclass(frozen=True)
class Machine:
    """The robot, and what its file does not say."""

    robot: Annotated[str, Argument(autocompletion=find_robots)]
    sidecar: str | None = None
    lock: Annotated[Sequence[str] | None, Option(metavar="NAME[=VALUE]")] = None
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
    """What logs of the robot call things."""

    map: Annotated[Sequence[str] | None, Option(metavar="OLD=NEW")] = None
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
    """Where results are written."""

    report: Report = None
    json: Annotated[Path | None, Writes(".json")] = None

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


def _panel(title: str) -> Any:
    return Option(rich_help_panel=title)


_DERIVED, _RUNS = _panel("Velocity and acceleration"), _panel("Where it runs")


@dataclass(frozen=True)
class Derived:
    """How logs become motion."""

    derivatives: Annotated[Derivatives, _DERIVED] = "auto"
    cutoff: Annotated[Positive | None, _DERIVED] = None
    period: Annotated[Positive | None, _DERIVED] = None
    harmonics: Annotated[Count, _DERIVED] = 5
    decimate: Annotated[Count | None, _DERIVED] = None

    def preparation(self) -> Preparation | None:
        """Return what was asked for; None if nothing was."""
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415

        return None if self == Derived() else Preparation(**asdict(self))


@dataclass(frozen=True)
class Place:
    """Where long work runs."""

    engine: Annotated[EngineName | None, _RUNS] = None
    workers: Annotated[Count | None, _RUNS] = None
    scheduler: Annotated[str | None, _RUNS] = None
    resume: Annotated[Path | None, _RUNS] = None

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
