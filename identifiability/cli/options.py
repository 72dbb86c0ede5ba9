"""How dataclasses of options become the options of a command.

A verb is a function. Its parameters are groups of options, such as ``machine: Machine``, and single
options. `command` makes a command of it. The notes in ``Annotated`` describe an option. typer's
`Option` gives its spelling. `Expected` gives its range, which the API's functions share. `Reads`,
`Writes`, `Records` and `Parsed` say how its value is used. Its help text stands in ``help.toml``. A
group with a `table` holds settings: keys of that table of the sidecar, which ``--set`` overrides.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from dataclasses import asdict, astuple, dataclass, is_dataclass
from functools import cache
from inspect import Parameter, Signature, signature
from mimetypes import guess_type
from pathlib import Path
from string import Template
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
from typer.core import TyperArgument
from typer.models import OptionInfo, ParameterInfo

from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.errors import OutputError, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.options import (
    AngleUnit,
    Count,
    Derivatives,
    EstimatorKind,
    Expected,
    NotNegative,
    OptionError,
    Positive,
    Replicates,
    Root,
    Side,
    TimeUnit,
    check_option,
    choices,
)
from identifiability.foundation.values import Fields
from identifiability.foundation.wording import EFFECT
from identifiability.physical.rules import RULES as PHYSICAL_RULES

from .case import CASE, COMMANDS, defaults_of_case
from .common import (
    VERBOSE,
    Write,
    check_outputs,
    print_end,
    print_help,
    progress,
    sentences,
    write_all,
)

if TYPE_CHECKING:
    from identifiability.foundation.engines import Engine
    from identifiability.foundation.result import Result
    from identifiability.foundation.runs import Progress
    from identifiability.logs.prepare import Preparation
    from identifiability.robot import Robot

#: Options that take effects, and verbs in which an option of that name takes something else.
TAKES_EFFECTS = {"effects": (), "hide": (), "separate": (), "model": ("calibrate",)}


#: Verbs whose help explains the settings of all verbs, and lists the effects.
EXPLAINS, LISTS_EFFECTS = "inspect", "diagnose"

#: Verbs whose help lists the shipped robots.
LIST_ROBOTS = ("new", "inspect", "simulate")


@cache
def helps() -> Fields:
    """Return the texts of ``help.toml``, with numbers of the code filled in."""
    text = Path(__file__).with_name("help.toml").read_text("utf-8")
    return tomllib.loads(Template(text).substitute(help_numbers()))


def help_numbers() -> dict[str, str]:
    """Return the constants of the code that help states, by their names in ``help.toml``."""
    rules = {"body_within": PHYSICAL_RULES.body_within, "name_odds": ESTIMATION_RULES.name}
    return {name: f"{value:,g}" for name, value in (vars(DEFAULTS) | rules).items()}


# Descriptions of an option, in addition to its type.


@dataclass(frozen=True)
class Parsed:
    """Mark an option whose text `read` converts; `read` takes the option's name and its text."""

    read: Callable[[str, str], Any]


@dataclass(frozen=True)
class Reads:
    """Mark an option as a document to read: its content, its format, and whether it is required.

    If it is not required, a value without the format's ending is not taken for a path.
    """

    what: str
    form: str
    always: bool = True

    def check(self, value: Any) -> None:
        """Refuse a path without a document.

        Raises
        ------
        OptionError
        """
        path = Path(value)
        form = f".{self.form.lower()}"
        meant = self.always or path.suffix.lower() == form
        if meant and not path.exists():
            raise OptionError(f"There is no {self.what} file '{value}'; give a {self.form} file.")


@dataclass(frozen=True)
class Records:
    """Mark an option as logs to read; `results` says whether results may be given instead."""

    results: bool = False


class Writes:
    """Marks an option as a file that is written, with its endings; without any, as a folder."""

    def __init__(self, *endings: str) -> None:
        self.endings = endings

    def check(self, value: Any) -> None:
        """Refuse a name that ends as if it were of another format.

        Raises
        ------
        OutputError
        """
        from identifiability.foundation.output import check_ending  # noqa: PLC0415

        if self.endings:
            check_ending(value, *self.endings)
        elif Path(value).is_file() or guess_type(str(value))[0] or str(value).endswith(".toml"):
            raise OutputError(f"'{value}' is the name of a file; give that of a folder.")


@dataclass(frozen=True)
class Field:
    """An option: its name, its default, its type on the command line, and its notes."""

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

    def marks(self, kind: type) -> list[Any]:
        """Return the notes of one type."""
        return [note for note in self.notes if isinstance(note, kind)]

    def text(self, verb: str) -> str:
        """Return its help text for a verb, with the range of its values."""
        said = helps()["options"]
        of_verb = said.get(verb, {}).get(self.name)
        told = [of_verb or said["all"].get(self.name, "")]
        told += [f"({r.words})" for r in self.marks(Expected)]
        return " ".join(told)

    @property
    def values(self) -> str:
        """Return the possible values of a setting, as the user types them."""
        known = estimators() if self.name == "method" else choices(self.kind)
        known = ["true", "false"] if self.kind is bool else known
        if known:
            return f"{self.name}={'|'.join(known)}"
        return self.name

    def parameter(self, verb: str) -> Parameter:
        """Return it as typer reads it in a verb."""
        required = self.default is Parameter.empty
        infos = [copy(n) for n in self.marks(ParameterInfo)]
        info = infos[0] if infos else Argument() if required else Option()
        info.help = self.text(verb)
        if isinstance(info, OptionInfo):
            self._describe_option(info)
        no_value = self.default == () or (self.default is False and self.kind is not bool)
        default = None if no_value else self.default
        kind = self.kind | None if default is None else self.kind
        as_typer: Any = Annotated[kind, info]
        return Parameter(
            self.name,
            Parameter.KEYWORD_ONLY,
            default=default,
            annotation=as_typer,
        )

    def _describe_option(self, info: OptionInfo) -> None:
        """Set the group and the look of the option in the help."""
        panels = helps()["panels"].items()
        info.rich_help_panel = next((title for title, names in panels if self.name in names), "How")
        if get_origin(self.kind) is list:
            info.metavar = f"{info.metavar or 'NAME'} …"
        if self.kind is bool and self.default is False:
            info.param_decls = (self.spelling,)
            info.metavar = ""
            info.show_default = False

    def read(self, typed: Any) -> Any:
        """Convert a typed value to the type that the library takes.

        Raises
        ------
        OptionError
            If the value is not valid for the option.
        """
        if typed is None:
            return self.default
        for rule in self.marks(Expected):
            check_option(self.spelling, typed, Annotated[self.kind, rule])
        for mark in self.marks(Parsed):
            typed = mark.read(self.spelling, typed)
        return typed


def _take_apart(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without None, and all notes of its ``Annotated``."""
    inner = get_args(annotation)
    if get_origin(annotation) is Annotated:
        kind, notes = _take_apart(inner[0])
        return kind, (*notes, *inner[1:])
    if get_origin(annotation) in (Union, UnionType):
        return _take_apart(next(kind for kind in inner if kind is not NoneType))
    return annotation, ()


def options_of(holder: Any) -> list[Field]:
    """Return the options of a function, or of a group."""
    kinds = get_type_hints(holder, include_extras=True)
    given = signature(holder).parameters
    return [Field.of(name, kinds[name], given[name].default) for name in given]


# Verbs.


@dataclass(frozen=True)
class Verb:
    """A command that is built when its verb is typed, because all verbs would slow the help."""

    function: Callable[..., None]

    def made(self, name: str) -> Any:
        """Return it with its options, as typer has it."""
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        run, settings, options = _flattened(self.function)
        described = helps()["verbs"].get(name)
        alone.command(name, cls=Command, help=described)(run)
        made: Any = typer.main.get_command(alone)
        made.settings = settings
        made.options = options
        return made


def _flattened(
    function: Callable[..., None],
) -> tuple[Callable[..., None], dict[str, Field], dict[str, Field]]:
    """Return a function as typer reads it, its settings, and its options with those of groups."""
    own = options_of(function)
    settings: dict[str, Field] = {}
    options: dict[str, Field] = {}
    tables: dict[str, str] = {}

    def add(fields: Iterable[Field], table: str | None) -> None:
        for field in fields:
            if is_dataclass(field.kind):
                add(options_of(field.kind), getattr(field.kind, "table", None))
            elif table is None:
                options[field.name] = field
            else:
                options[SET.name] = SET
                settings[field.name] = field
                tables[field.name] = table

    def build(field: Field, read: Mapping[str, Any]) -> Any:
        kind = field.kind
        if not is_dataclass(kind):
            return read[field.name]
        known = [f for f in options_of(kind) if is_dataclass(f.kind) or f.name in read]
        return kind(**{f.name: build(f, read) for f in known})  # type: ignore[operator]

    add(own, None)

    def called(**typed: Any) -> None:
        with sentences():
            case = CASE.get()
            if case is not None:
                typed["robot"] = case.robot
            _look(function.__name__, typed, options)
            read = {name: option.read(typed[name]) for name, option in options.items()}
            read |= _read_settings(settings, tables, read.pop(SET.name, ()), typed)
            given = {field.name: build(field, read) for field in own}
            from identifiability.logs.formats.reader import check_there  # noqa: PLC0415

            for path in _recordings(typed, options)[0]:
                check_there(Path(path))
            function(**given)

    flat = [option.parameter(function.__name__) for option in options.values()]
    called.__signature__ = Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {p.name: p.annotation for p in flat}
    return called, settings, options


#: Options that take a model file; a verb has one of them.
MODEL_OPTIONS = {"--ladder": "--model", "--model": "--ladder"}


class Command(typer.core.TyperCommand):
    """A command whose help lists effects, settings and robots; the list is made on request."""

    settings: Mapping[str, Field]
    options: Mapping[str, Field]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help: examples, explanation, options in groups, settings and lists."""
        print_help(self.collect_usage_pieces(ctx), str(self.help), self._groups(ctx), self._lists())

    def _groups(self, ctx: Any) -> dict[str, list[tuple[str, str]]]:
        """Return the options, and the settings, with their texts by their group."""
        groups: dict[str, list[tuple[str, str]]] = {"Arguments": []}
        groups |= {title: [] for title in (*helps()["panels"], "How")}
        for parameter in self.params:
            record = parameter.get_help_record(ctx)
            if record is not None and parameter.name != "help":
                name, text = record
                title = getattr(parameter, "rich_help_panel", None) or "Arguments"
                named = name.partition(" ")[0] if title == "Arguments" else name
                groups[title].append((named, text))
        groups["Settings (--set KEY=VALUE)"] = [
            (field.values, field.text(str(self.name))) for field in self._explained()
        ]
        return {title: rows for title, rows in groups.items() if rows}

    def _explained(self) -> list[Field]:
        """Return the settings that the help explains: all in `inspect`, elsewhere the verb's."""
        common = () if self.name == EXPLAINS else helps()["common"]
        return [field for name, field in self.settings.items() if name not in common]

    def _lists(self) -> list[str]:
        """Return the names of effects and shipped robots that options take."""
        listed = []
        for parameter in self.params:
            name = str(parameter.name)
            if name in TAKES_EFFECTS and str(self.name) not in TAKES_EFFECTS[name]:
                where = f"`identifiability {LISTS_EFFECTS} --help` lists them"
                alone = name == "hide" or self.name == LISTS_EFFECTS
                listed.append(f"Effects: {', '.join(effects(name)) if alone else where}.")
            if name == "robot" and self.name in LIST_ROBOTS:
                listed.append(f"Shipped robots: {', '.join(shipped_robots())}")
        explained = self._explained()
        others = [field.values for field in self.settings.values() if field not in explained]
        if others:
            listed.append(f"More settings ({EXPLAINS} --help explains them): {', '.join(others)}.")
        return [*dict.fromkeys(listed), "With -v a verb also prints tables, hints and reasons."]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take -v; refuse a setting that is typed as an option, and show the right spelling."""
        typed = args[: args.index("--")] if "--" in args else args
        loud = {"-v", "--verbose"}.intersection(typed)
        VERBOSE.set(bool(loud))
        names = {name for parameter in self.params for name in parameter.opts}
        for at, given in enumerate(typed):
            option, equals, value = given.partition("=")
            rival = MODEL_OPTIONS.get(option)
            if option not in names and rival in names:
                ctx.fail(f"{self.name} has no {option}: type {rival} model.toml.")
            key = option.removeprefix("--").replace("-", "_")
            if not option.startswith("--") or key not in self.settings:
                continue
            follows = value if equals else next(iter(typed[at + 1 :]), "VALUE")
            told = "true" if self.settings[key].kind is bool else follows
            ctx.fail(f"{option} is a setting: type --set {key}={told}.")
        words = [given for given in args if given not in loud]
        self._insert_folder(ctx, words)
        ctx.default_map = self._read_case(ctx, words)
        return super().parse_args(ctx, words)

    def _insert_folder(self, ctx: Any, words: list[str]) -> None:
        """Insert ``.`` before a log that is typed in place of the robot in the folder of a case."""
        if not Path("case.toml").is_file():
            return
        parsed, _, _ = self.make_parser(ctx).parse_args(args=[*words])
        first = parsed.get("robot")
        if not isinstance(first, str) or first not in words:
            return
        from identifiability.robot.locate import ENDINGS  # noqa: PLC0415

        if Path(first).suffix.lower() in ENDINGS:
            return
        from identifiability.logs.tables import is_log_file  # noqa: PLC0415

        if is_log_file(Path(first)):
            words.insert(words.index(first), ".")

    def _read_case(self, ctx: Any, words: list[str]) -> Fields:
        """Return the values of the case file for options that were not typed.

        The case is that of the working folder, or of a folder that is typed in place of the robot.
        If the robot file of the case is typed, its sidecar and locks are used, but not its logs.
        """
        CASE.set(None)
        if {"--help", "--each"}.intersection(words):
            return {}
        parsed, _, _ = self.make_parser(ctx).parse_args(args=[*words])
        typed = {name: x for name, x in parsed.items() if isinstance(x, (str, list, tuple))}
        robot = str(typed.get("robot", "."))
        is_folder = False
        with suppress(OSError):  # a name that is too long
            is_folder = Path(robot).is_dir()
        # Before large imports: those of a case, and of values that typer converts.
        with sentences():
            _look(str(self.name), typed | ({"robot": None} if is_folder else {}), self.options)
        takes_robot = any(isinstance(p, TyperArgument) and p.name == "robot" for p in self.params)
        folder = robot if is_folder else "."
        if not takes_robot or not (Path(folder) / "case.toml").is_file():
            return {}
        from identifiability.workflows.case_file import CaseFile  # noqa: PLC0415

        with sentences():
            case = CaseFile.read(folder)
        if not is_folder and Path(robot) != Path(case.robot):
            return {}
        CASE.set(case)
        COMMANDS.set(ctx.find_root().command.commands)
        said = {"sidecar": case.sidecar, "lock": case.entry.lock}
        if is_folder:
            has_logs = isinstance(typed.get("logs"), (list, tuple))
            said |= defaults_of_case(case, str(self.name), has_logs=has_logs)
        return {name: value for name, value in said.items() if value not in (None, [])}


# Checks before any large import: do the files exist, and can they be written?


def _check_kind(path: Path, kinds: Sequence[str]) -> None:
    """Refuse to overwrite a file whose first lines are not a result of the given kinds.

    Raises
    ------
    IdentifiabilityError
    """
    head = b""
    if path.is_file():  # to read a pipe would wait for who writes it
        with suppress(OSError), path.open("rb") as stream:
            head = stream.read(2000)
    found = re.search(rb'"identifiability/(\w+)/\d', head)
    if head and (found is None or found[1].decode() not in kinds):
        what = f"the result of another verb ({found[1].decode()})" if found else "no such result"
        raise OutputError(Finding("output.other", path, what=what))


def _look(verb: str, typed: Mapping[str, Any], options: Mapping[str, Field]) -> None:
    """Refuse missing inputs and outputs that cannot be written, before any computation.

    Raises
    ------
    IdentifiabilityError
    """
    given = [(o, typed[n]) for n, o in options.items() if typed.get(n) not in (None, [])]
    reads = [(mark, value) for o, value in given for mark in o.marks(Reads)]
    writes = [(o.name, mark, Path(value)) for o, value in given for mark in o.marks(Writes)]
    logs, results = _recordings(typed, options)
    robot = typed.get("robot") or None
    inputs = [robot, typed.get("sidecar"), *logs, *results, *(value for _, value in reads)]
    check_outputs(*(value for _, mark, value in writes if mark.endings), inputs=inputs)
    kinds = helps()["results"]
    for name, ends, value in writes:
        ends.check(value)
        if value.suffix.lower() in (".json", ".html", ".htm"):
            _check_kind(value, kinds.get(name) or kinds.get(verb) or [verb])
    if robot is not None:
        from identifiability.robot.locate import locate_robot  # noqa: PLC0415

        locate_robot(robot)
    reads += [(Reads("result", "JSON"), path) for path in results]
    # A colon precedes a part of a file, which the reader of its format finds.
    reads += [(Reads("log", "CSV or Parquet"), path) for path in logs if ":" not in path]
    for mark, value in reads:
        mark.check(value)


def _recordings(
    typed: Mapping[str, Any], options: Mapping[str, Field]
) -> tuple[list[str], list[str]]:
    """Return the logs that were typed, and results among them."""
    logs: list[str] = []
    results: list[str] = []
    for name, option in options.items():
        for mark in option.marks(Records):
            value = typed.get(name) or ()
            for path in [value] if isinstance(value, str) else value:
                if name == "validate" and path == "none":  # nothing is held out
                    continue
                as_result = mark.results and Path(path).suffix.lower() in (".json", ".xml", ".urdf")
                (results if as_result else logs).append(path)
    return logs, results


# Settings: of the sidecar, and of --set.

SET = Field("set", list[str], (), (Option("--set", metavar="KEY=VALUE"),))


def _read_settings(
    settings: Mapping[str, Field],
    tables: Mapping[str, str],
    typed: Sequence[str],
    given: Mapping[str, Any],
) -> Fields:
    """Return the checked settings of the sidecar and the command line.

    Raises
    ------
    OptionError
        If one is no setting of the verb.
    """
    found: Fields = {}
    if any(tables.values()) and given.get("robot"):
        from identifiability.robot.sidecar import read_settings  # noqa: PLC0415

        stated = read_settings(given["robot"], given.get("sidecar"))
        for group in (Derived, Place, Judged):
            table = group.table
            known = [field.name for field in options_of(group)]
            for key in stated[table]:
                if key in getattr(group, "typed", ()):
                    raise OptionError(Finding("option.typed", key, table=table))
                check_option(f"A key of the sidecar's [{table}]", key, Literal[tuple(known)])
            found |= {k: v for k, v in stated[table].items() if tables.get(k) == table}
    case = CASE.get()
    if case is not None:
        found |= {k: v for k, v in case.settings.items() if k in settings}
    for text in typed:
        key, equals, value = text.partition("=")
        if key not in settings or not equals:
            near = near_match(key, settings)
            raise OptionError(f"--set {text} is no KEY=VALUE of {', '.join(settings)}{near}")
        found[key] = _as_kind(settings[key].kind, value)
    for key, value in found.items():
        kind = settings[key].kind
        whole: Any = kind
        for note in settings[key].marks(Expected):
            whole = Annotated[whole, note]
        check_option(key, value, str if kind is Path else whole)
        if kind is Path:
            found[key] = Path(value)
    return found


def _as_kind(kind: Any, text: str) -> Any:
    """Convert a text to a type; return the text itself if that fails."""
    if kind is bool:
        return {"true": True, "false": False}.get(text.lower(), text)
    with suppress(ValueError):
        return kind(text) if kind in (int, float) else text
    return text


# Values that options accept.


def split_names(_: str, text: str) -> list[str]:
    """Return the names in ``a,b c``; of ``a@joint:0.1,2,b`` a shape has two numbers."""
    return re.findall(EFFECT, text)


def split_model(option: str, text: str) -> list[str] | str:
    """Return the effects in ``a,b``, or the unchanged path of a model file."""
    if text.lower().endswith(".toml"):
        return text
    return split_names(option, text)


def split_point(option: str, text: str) -> list[float]:
    """Return the numbers in ``x,y,z``.

    Raises
    ------
    OptionError
    """
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise OptionError(Finding("option.point", option, text=text)) from None


def keep_values(option: str, text: str) -> bool | float | str:
    """Return how values of the robot file are kept: exactly, within a share, or as a result has.

    Raises
    ------
    OptionError
    """
    if text == "exact":
        return True
    if text.lower().endswith(".json"):
        Reads("result", "JSON").check(text)
        return text
    try:
        return float(text)
    except ValueError:
        raise OptionError(Finding("option.kept", option, text=text)) from None


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    from identifiability.robot import locate  # noqa: PLC0415

    return locate.shipped_robots()


def estimators() -> list[str]:
    """Return the registered estimators, a plugin's among them."""
    module = sys.modules.get("identifiability.estimation.estimate")
    return list(helps()["methods"] if module is None else module.ESTIMATORS)


def effects(option: str) -> list[str]:
    """Return the effects that an option takes, a plugin's among them."""
    registry = sys.modules.get("identifiability.effects.registry")
    if option == "hide":
        return [*helps()["hide"], *(() if registry is None else registry.effect_laws())]
    return list(helps()["effects"] if registry is None else registry.FAMILIES)


def _load_plugins(context: typer.Context, paths: list[Path] | None) -> list[Path]:
    """Register the effects of the user's files before the command, or its help, reads effects."""
    if paths and not context.resilient_parsing:
        from identifiability.effects import load_plugin  # noqa: PLC0415

        with sentences():
            for path in paths:
                load_plugin(path)
    return paths or []


# Groups of options that several verbs have.

Logs = Annotated[list[str], Records()]
MoreLogs = Annotated[Sequence[str], Records()]
OptionalLogs = Annotated[Sequence[str], Argument(), Records()]
#: Outputs of analyze, prune and diagnose.
JsonResult = Annotated[Path, Reads("result", "JSON")]
Table = Writes(".csv", ".parquet", ".pq")
Report = Annotated[Path | None, Writes(".html", ".htm")]
ModelOut = Annotated[Path | None, Writes(".toml")]
Effects = Annotated[str | None, Parsed(split_names)]
Ladder = Annotated[str | None, Reads("ladder", "TOML")]
Limits = Annotated[Path | None, Reads("limits", "TOML")]
Model = Annotated[str | None, Reads("model", "TOML", always=False), Parsed(split_model)]

Fixed = Annotated[str | bool, Option(metavar="exact|SHARE|RESULT"), Parsed(keep_values)]
Prior = NotNegative | None
Point = Annotated[str, Option(metavar="X,Y,Z"), Parsed(split_point)]


@dataclass(frozen=True)
class Recorded:
    """How logs of the robot were recorded; the sidecar has other names for these keys."""

    table = ""

    base: Root | None = None
    time_unit: TimeUnit | None = None
    angles: AngleUnit | None = None
    torque_side: Side | None = None


@dataclass(frozen=True)
class Machine:
    """The robot, additions to its file, and the column names of its logs."""

    robot: Annotated[str, Argument()]
    sidecar: str | None = None
    lock: Annotated[Sequence[str] | None, Option(metavar="NAME[=VALUE]")] = None
    map: Annotated[Sequence[str] | None, Option(metavar="OLD=NEW")] = None
    plugin: Annotated[list[Path] | None, Option(callback=_load_plugins, is_eager=True)] = None
    recorded: Recorded = Recorded()

    def load(self) -> Robot:
        """Return the robot with the conventions of its logs.

        Raises
        ------
        OptionError
            If --map has no pairs of names.
        """
        from identifiability.robot import Robot  # noqa: PLC0415

        rules: dict[str, str] = {}
        for given in self.map or ():
            old, equals, new = given.rpartition("=")
            if not (old and equals and new):
                raise OptionError(Finding("option.map", given=given))
            if rules.setdefault(old, new) != new:
                raise OptionError(f"--map gives '{old}' two names, {rules[old]} and {new}.")
        robot = Robot.load(self.robot, self.sidecar, rules, self.lock, **asdict(self.recorded))
        case = CASE.get()
        if case is None:
            return robot
        return case.with_masses(robot)


@dataclass(frozen=True)
class Derived:
    """How logs become motion."""

    table = "preparation"

    derivatives: Derivatives = "auto"
    cutoff: Positive | None = None
    decimate: Count | None = None

    def preparation(self) -> Preparation | None:
        """Return the preparation that was requested; None if no option was set."""
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415

        if self == Derived():
            return None
        return Preparation(**asdict(self))


@dataclass(frozen=True)
class Place:
    """The engine for long computations."""

    table = "run"

    #: A cluster sends objects that may run code, so no sidecar names it.
    typed = ("scheduler",)

    workers: Count | None = None
    scheduler: str | None = None

    @contextmanager
    def running(self) -> Iterator[Engine]:
        """Give the engine; its processes end with it."""
        from identifiability.foundation.engines import choose_engine  # noqa: PLC0415

        with choose_engine(*astuple(self)) as engine:
            yield engine


@dataclass(frozen=True)
class Work:
    """How logs become motion, and the engine for long computations."""

    derived: Derived = Derived()
    place: Place = Place()

    @contextmanager
    def running(self) -> Iterator[tuple[Progress, Fields, Engine]]:
        """Yield the progress callback, the common options of fits, and the engine."""
        with progress() as say, self.place.running() as engine:
            # A verb ends its processes sooner by itself.
            asked = engine if self.place != Place() else None
            preparation = self.derived.preparation()
            yield say, {"preparation": preparation, "engine": asked, "progress": say}, engine


@contextmanager
def alone() -> Iterator[tuple[Progress, Fields, None]]:
    """Give the same to a verb that is done at once."""
    with progress() as say:
        say("reading logs", 0.0)
        yield say, {}, None


@dataclass(frozen=True)
class Fitted:
    """How parameters are estimated."""

    table = "fit"

    method: str = "wls"
    estimator: EstimatorKind = "auto"
    cad_prior: NotNegative | None = None


@dataclass(frozen=True)
class Judged(Fitted):
    """How `analyze` estimates and judges parameters."""

    replicates: Replicates | None = None


@dataclass(frozen=True)
class Outputs:
    """Paths of the results."""

    report: Report = None
    json: Annotated[Path | None, Writes(".json")] = None

    def write_first(self, result: Result) -> None:
        """Write the page of a first answer, which the page of the whole answer replaces."""
        from identifiability.report.answers.common import sentence  # noqa: PLC0415

        assert self.report is not None
        path = result.write_report(self.report)
        print_end([sentence("first_answer", "written", path=path)])

    def write(
        self,
        result: Result,
        say: Progress,
        *first: tuple[Write, Path | None],
    ) -> list[Path]:
        """Write the requested files and return their paths; `first` have functions of their own.

        Raises
        ------
        OutputError
            If a file cannot be written at its path. It is then written elsewhere, and the error
            names that path.
        """

        def draw(path: Path) -> Path:
            say("drawing the report", 0.98)
            return result.write_report(path)

        return write_all(*first, (result.to_json, self.json), (draw, self.report))
