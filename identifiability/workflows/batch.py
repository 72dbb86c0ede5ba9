"""Many robots at once: one verb over all of them, one table and a page each; what is done is kept.

A study is a TOML file: a verb with its options, and robots with their logs, by pattern. A robot is
one item of an engine, so its answer does not depend on where it was found; what is finished stands
in the folder of the answers, under a key of all that led to it, and is not done again.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, field, fields, replace
from glob import escape, glob, has_magic
from inspect import Parameter, signature
from pathlib import Path
from shlex import quote
from statistics import median
from typing import IO, Annotated, Any, ClassVar, Literal, get_type_hints
from urllib.parse import quote as quote_link

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from identifiability.foundation.answers import Answer, Cell, Column, Note, Table
from identifiability.foundation.documents import described, first_problem, read_document
from identifiability.foundation.engines.local import Engine, Processes, Resumed, Serial
from identifiability.foundation.engines.resume import fingerprint
from identifiability.foundation.errors import IdentifiabilityError, OutputError, listing, near_match
from identifiability.foundation.numbers import percent
from identifiability.foundation.options import (
    Expected,
    FilePath,
    OptionError,
    check_option,
    checked,
)
from identifiability.foundation.output import temporary_folder, write_bytes
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import NONE, error_text, format_count
from identifiability.foundation.values import frozen
from identifiability.logs.formats.reader import check_there, find_reader
from identifiability.logs.prepare import Preparation
from identifiability.logs.tables import write_table
from identifiability.robot import Robot
from identifiability.robot.locate import locate_robot
from identifiability.workflows.analyze import analyze
from identifiability.workflows.answers import answer_next, hides_joints, list_worst, with_hints
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.opening import Progress
from identifiability.workflows.prune import prune

if sys.platform != "win32":
    import fcntl

# The study: what is asked, of which robots, with which logs.


Verb = Literal["analyze", "prune", "diagnose"]

#: Robots of a study.
MOST = 10_000

#: What stands in the folder of the answers.
PAGE, TABLE, FINISHED, ROBOTS = "index.html", "table.csv", "finished.jsonl", "robots"

#: Arguments of a verb that no file states.
_OURS = ("progress", "engine", "preparation", "rules")

#: Names that are files of every system.
_NAME = re.compile(r"\w[\w .+,=@()-]{0,99}")


class RobotEntry(BaseModel):
    """A robot, or one for every place that a pattern finds."""

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    file: str = described("Robot file (MJCF or URDF), or a shipped robot.", "arm.urdf")
    train: str | list[str] = described("Logs to fit; patterns are filled in.", "runs/fit*.csv")
    held: str | list[str] = described(
        "Logs that judge and are never fitted.", "runs/unseen*.csv", list, alias="validate"
    )
    each: str = described(
        "Pattern of folders, or files: one robot for each, which is `{each}` in the other keys.",
        "fleet/*",
        "",
    )
    name: str = described("What the table calls it; else its folder or its file.", "left arm", "")
    sidecar: str | None = described("As `--sidecar`.", "arm.toml", None)
    lock: list[str] = described("As `--lock`.", ["finger=0.02"], list)
    base: Literal["fixed", "floating"] | None = described("As `--base`.", "fixed", None)
    map: dict[str, str] = described("As `--map`.", {"j1": "joint_1"}, dict)
    time_unit: Literal["s", "ms", "us", "ns"] | None = described("As `--time-unit`.", "ms", None)
    angles: Literal["rad", "deg"] | None = described("As `--angles`.", "deg", None)
    options: dict[str, Any] = described("Options of the verb for it alone.", {"cutoff": 8}, dict)


class StudyEntry(BaseModel):
    """The file. Its paths and patterns begin in its folder."""

    model_config = ConfigDict(extra="forbid")

    verb: Verb = described("What is asked of every robot.", "analyze")
    options: dict[str, Any] = described("Options of the verb, as in Python.", {"seed": 1}, dict)
    robots: list[RobotEntry] = Field(min_length=1)


@frozen(kw_only=True)
class Task:
    """What is asked of one robot: all that leads to its answer, or why it cannot be asked.

    Attributes
    ----------
    name, verb, file : str
    loaded : mapping
        Arguments of `Robot.load`.
    train, held : tuple of str
        Logs.
    options : mapping
        Of the verb.
    digest : str
        Of the content of all files that are read.
    refusal : str
        One sentence.
    """

    name: str
    verb: str
    file: str
    loaded: Mapping[str, Any]
    train: tuple[str, ...] = ()
    held: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    digest: str = ""
    refusal: str = ""


def plan_tasks(study: StudyEntry, folder: Path) -> list[Task]:
    """Return what is asked of each robot of a study that begins in a folder.

    What the study names must be there; a place that a pattern found and that lacks something is a
    task with its refusal.

    Raises
    ------
    IdentifiabilityError
        If something is not there, an option is none of the verb's, or two robots have one name.
    """
    tasks: list[Task] = []
    for entry in study.robots:
        options = _check_options(study.verb, {**study.options, **entry.options}, folder)
        places = [""] if not entry.each else _match(folder, entry.each)
        if not places:
            raise OptionError(f"Nothing in '{folder}' is called '{entry.each}' (each).")
        if len(tasks) + len(places) > MOST:
            raise OptionError(f"The study has more than {MOST} robots; make several of it.")
        found = [_plan(study.verb, entry, options, folder, place) for place in places]
        if all(task.refusal for task in found):
            raise OptionError(found[0].refusal)
        tasks += found
    twice = [name for name, count in Counter(t.name.casefold() for t in tasks).items() if count > 1]
    if twice:
        raise OptionError(
            f"Two robots are called '{twice[0]}'; give each a name of its own, as name = "
            '"{each}" where they are found by a pattern.'
        )
    return tasks


def _plan(verb: str, entry: RobotEntry, options: dict[str, Any], folder: Path, place: str) -> Task:
    def filled(text: str) -> str:
        return text.replace("{each}", place)

    def at(text: str) -> str:
        near = Path(folder, filled(text))
        return str(near.absolute()) if near.exists() else filled(text)

    named = filled(entry.name) or Path(place or filled(entry.file)).stem
    if not entry.name and not place and named == "robot":
        named = Path(folder.resolve(), filled(entry.file)).parent.name
    name = named.replace("/", "-").replace("\\", "-").strip()
    if not _NAME.fullmatch(name):
        raise OptionError(
            f"'{name}' cannot be the name of a robot's page; give a name of letters and digits."
        )
    loaded = {
        "sidecar": None if entry.sidecar is None else at(entry.sidecar),
        "columns": entry.map or None,
        "lock": entry.lock or None,
        "time_unit": entry.time_unit,
        "angles": entry.angles,
        "base": entry.base,
    }
    task = Task(name=name, verb=verb, file=at(entry.file), loaded=loaded, options=options)
    try:
        locate_robot(task.file)
        train, held = (tuple(_find_logs(each, folder, place)) for each in (entry.train, entry.held))
        if not train:
            raise OptionError(f"'{name}' has no logs; name them in train.")
        return replace(task, train=train, held=held, digest=_digest(task, (*train, *held)))
    except IdentifiabilityError as error:
        return replace(task, refusal=str(error))


def _match(folder: Path, pattern: str) -> list[str]:
    """Return what has a name of a pattern, seen from a folder; the pattern may leave it."""
    return sorted(glob(pattern, root_dir=folder, recursive=True))  # noqa: PTH207


def _find_logs(patterns: str | Sequence[str], folder: Path, place: str) -> Iterator[str]:
    """Yield the logs of some patterns, each once and in order.

    Raises
    ------
    IdentifiabilityError
        If one finds nothing.
    """
    seen = set()
    for text in [patterns] if isinstance(patterns, str) else patterns:
        if has_magic(text):
            found = _match(folder, text.replace("{each}", escape(place)))
        else:
            found = [text.replace("{each}", place)]
            check_there(Path(folder, found[0]))
        if not found:
            shown = text.replace("{each}", place)
            raise OptionError(f"No log in '{folder}' is called '{shown}'; give another pattern.")
        for path in found:
            if path not in seen:
                yield str(Path(folder, path).absolute())
        seen.update(found)


def _digest(task: Task, logs: Sequence[str]) -> str:
    """Return a digest of the content of all files that lead to an answer."""
    robot = Robot.load(task.file, **task.loaded)
    texts = [Path(v) for v in task.options.values() if isinstance(v, str)]
    ladder = robot.path.with_name("ladder.toml")  # analyze takes it without being told
    places = [p for p in (*texts, ladder) if p.is_file()]
    for text in logs:
        log = Path(text)
        reader = find_reader(log)
        place: Path = log if reader is None else reader.place(log)
        places += sorted(p for p in place.rglob("*") if p.is_file()) if place.is_dir() else [place]
    digest = hashlib.sha256(robot.sha256.encode())
    for place in places:
        with place.open("rb") as stream:
            digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


def _function(verb: str) -> Any:
    return {"analyze": analyze, "prune": prune, "diagnose": diagnose}[verb]


def _check_options(verb: str, given: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return options of a verb, paths of files from a folder on.

    Raises
    ------
    OptionError
    """
    function = _function(verb)
    own = [n for n, p in signature(function).parameters.items() if p.kind is Parameter.KEYWORD_ONLY]
    own += ["ladder"] if "ladder" in signature(function).parameters else []
    kinds = get_type_hints(function, include_extras=True)
    known = {name: kinds[name] for name in own if name not in _OURS}
    known |= get_type_hints(Preparation, include_extras=True)
    for name, value in given.items():
        if name not in known:
            raise OptionError(
                f"'{name}' is no option of {verb}{near_match(name, known)} "
                f"Its options are {listing(sorted(known), 40)}."
            )
        check_option(name, value, known[name])
    return {
        name: str((folder / value).absolute())
        if isinstance(value, str) and (folder / value).is_file()
        else value
        for name, value in given.items()
    }


# The answer of one robot.


@frozen(kw_only=True)
class Row:
    """What the table says of one robot.

    Attributes
    ----------
    robot : str
        Its name in the study.
    file : str
        Of the robot.
    logs, held : int
        How many are fitted, and judge.
    model : str
        That which is worth using; of a diagnosis that with what was missing.
    parameters : int or None
        Of that model.
    verdicts : mapping
        How many of them have which; none of a diagnosis.
    error, error_unseen : float or None
        Relative errors of that model on fitted and unseen motion.
    error_before : float or None
        Of a diagnosis: on unseen motion without what was missing.
    joints : str
        The errors of joints on unseen motion, worst first, where that of all together hides them.
    missing : tuple of str
        What is missing: of a diagnosis by name, else functions of which joint.
    warnings : tuple of str
        What to check in its logs and its file.
    failed : str
        Why there is no answer, in one sentence.
    """

    robot: str
    file: str
    logs: int = 0
    held: int = 0
    model: str = ""
    parameters: int | None = None
    verdicts: Mapping[str, int] = field(default_factory=dict)
    error: float | None = None
    error_unseen: float | None = None
    error_before: float | None = None
    joints: str = ""
    missing: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    failed: str = ""

    @property
    def unseen(self) -> float:
        """The error on unseen motion; NaN if it is not known."""
        return math.nan if self.error_unseen is None else self.error_unseen

    @property
    def page(self) -> str:
        """Its page, seen from the folder of the answers; empty if there is none."""
        return "" if self.failed else f"{ROBOTS}/{self.robot}.html"


@frozen
class Outcome:
    """What is made of one robot: its row, and the text of its JSON and its page."""

    row: Row
    json: bytes = b""
    page: bytes = b""


def run_task(task: Task) -> Outcome:
    """Ask one robot; whatever goes wrong is the sentence of its row."""
    row = Row(robot=task.name, file=Path(task.file).name, logs=len(task.train), held=len(task.held))
    if task.refusal:
        return Outcome(replace(row, failed=task.refusal))
    try:
        robot, options = Robot.load(task.file, **task.loaded), dict(task.options)
        how = {f.name: options.pop(f.name) for f in fields(Preparation) if f.name in options}
        result: Result = _function(task.verb)(
            robot,
            list(task.train),
            list(task.held),
            preparation=Preparation(**how) if how else None,
            engine=Serial(),
            **options,
        )
        with temporary_folder() as folder:
            told = result.to_json(Path(folder, f"{task.name}.json")).read_bytes()
            page = result.write_report(Path(folder, f"{task.name}.html")).read_bytes()
        return Outcome(_fill(row, json.loads(told)), told, page)
    except IdentifiabilityError as error:
        said = str(error)
    except MemoryError:
        said = "There is not enough memory for it; give fewer workers."
    except Exception as error:  # noqa: BLE001 - one robot does not end the others
        said = f"It met a fault of this program, please report it: {type(error).__name__}: {error}."
    return Outcome(replace(row, failed=said))


def _fill(row: Row, told: Mapping[str, Any]) -> Row:
    """Return a row with what the JSON of a result says."""
    row = replace(row, warnings=tuple(told["hints"]))
    if "models" not in told:  # a diagnosis
        named = [" or ".join([e["effect"], *e["or"]]) for e in told["effects"]]
        where = [", ".join(e["joints"]) for e in told["effects"]]
        return replace(
            row,
            model=told["fit"]["model"]["name"],
            parameters=len(told["fit"]["names"]),
            missing=tuple(f"{n}@{j}" if j else n for n, j in zip(named, where, strict=True)),
            error=told["after"]["error_ra"],
            error_unseen=told["after"]["error_ra_validation"],
            error_before=told["before"]["error_ra_validation"],
            joints=_worst_joints(told, "after", told["after"]["error_ra_validation"]),
        )
    chosen = next(m for m in told["models"] if m["name"] == told["selected"])
    unseen = (chosen.get("error_ra_validation"), chosen.get("error_ra_unseen"))
    error = next((e for e in unseen if e is not None), None)
    return replace(
        row,
        model=chosen["name"],
        parameters=len(told["parameters"]),
        verdicts=dict(Counter(p["verdict"] for p in told["parameters"])),
        error=chosen["error_ra"],
        error_unseen=error,
        joints=_worst_joints(told, "error_validation", error),
        missing=tuple(f"{f['of']}, {f['joint']}" for f in told["missing_functions"]),
    )


def _worst_joints(told: Mapping[str, Any], kind: str, together: float | None) -> str:
    """Return the errors of joints where they differ, of a result as JSON has it."""
    rows = told["errors"].get("joints", [])
    each = np.array([np.nan if row[kind] is None else row[kind] for row in rows], float)
    if together is None or not hides_joints(each, together):
        return ""
    return list_worst([row["joint"] for row in rows], 100 * each, "%")


# The answer of the study.


@frozen(kw_only=True)
class Batch(Result):
    """The answers of a study. Make it with `batch`.

    Attributes
    ----------
    name, verb : str
    folder : Path
        Where the table and the pages are.
    rows : tuple of Row
        One a robot.
    found : int
        Robots that were done before, and not again.
    study : str
        Path of the file that asks; empty of a mapping.
    """

    schema: ClassVar[str] = "identifiability/batch/1"

    name: str
    verb: str
    folder: Path
    rows: tuple[Row, ...]
    found: int = 0
    study: str = ""

    @property
    def done(self) -> tuple[Row, ...]:
        """Robots that have an answer."""
        return tuple(row for row in self.rows if not row.failed)

    @property
    def failed(self) -> tuple[Row, ...]:
        """Robots that have none."""
        return tuple(row for row in self.rows if row.failed)

    @property
    def worst(self) -> tuple[Row, ...]:
        """Robots with an error on unseen motion, the largest first."""
        known = [row for row in self.done if not math.isnan(row.unseen)]
        return tuple(sorted(known, key=lambda row: -row.unseen))

    @property
    def heading(self) -> tuple[str, str, str]:
        """Title of its page, what kind of page it is, and what it is about."""
        return self.name, "Batch", f"{self.verb} · {format_count(len(self.rows), 'robot')}"

    def cautions(self) -> tuple[Note, ...]:
        """Return why robots have no answer, and what to check in logs and files, by robot."""
        failed = [Note("warning", row.robot, row.failed) for row in self.failed]
        odd = [Note("note", row.robot, " ".join(row.warnings)) for row in self.done if row.warnings]
        return (*failed, *odd)

    def answers(self) -> tuple[Answer, ...]:
        """Return whether every robot has an answer, how well they are described, what to check."""
        return _done(self), _errors(self), _check(self), _next(self)

    def tables(self) -> tuple[Table, ...]:
        """Return one row a robot."""
        kinds = list(dict.fromkeys(kind for row in self.rows for kind in row.verdicts))
        before = [_error("before", "error_before")] if self.verb == "diagnose" else []
        own = with_hints(
            "batch",
            Column("robot", "text", _link),
            Column("model", "text", "model"),
            Column("size", "number", "parameters"),
            *map(_count, sorted(kinds)),
            _error("error", "error"),
            *before,
            _error("unseen", "error_unseen", "joints"),
            Column("missing", "text", lambda row: "; ".join(row.missing) or NONE),
            Column("warnings", "number", lambda row: len(row.warnings)),
        )
        return (Table.of("One row a robot, whose name leads to its own page", own, self.rows),)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        said = [f"{len(self.done)} of {len(self.rows)} robots have an answer."]
        said += [f"{row.robot} has none: {row.failed}" for row in self.failed[:3]]
        if len(self.failed) > 3:
            said.append(f"So have {len(self.failed) - 3} more, as the table says.")
        if self.worst:
            errors = [row.unseen for row in self.worst]
            low, middle, high = map(percent, (errors[-1], median(errors), errors[0]))
            worst = listing(
                [
                    f"{r.robot} ({percent(r.unseen)}{f': {r.joints}' if r.joints else ''})"
                    for r in self.worst[:3]
                ]
            )
            size = f"{high} to {low} (median {middle}); the largest: {worst}"
            said.append(
                "Torque of unseen motion is predicted with an error of "
                f"{low if low == high else size}."
            )
        lacking = [row.robot for row in self.done if row.missing]
        if lacking:
            said.append(f"Of {len(lacking)} something is missing in the model: {listing(lacking)}.")
        warned = [row.robot for row in self.done if row.warnings]
        if warned:
            said.append(f"{len(warned)} have warnings: {listing(warned)}.")
        return " ".join(said)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a robot; errors are fractions."""
        kinds = sorted({kind for row in self.rows for kind in row.verdicts})
        return pd.DataFrame(
            {
                "robot": row.robot,
                "file": row.file,
                "logs": row.logs,
                "held": row.held,
                "model": row.model,
                "parameters": row.parameters,
                **{kind: row.verdicts.get(kind, 0) if row.verdicts else None for kind in kinds},
                "error": row.error,
                "error_unseen": row.error_unseen,
                **({"error_before": row.error_before} if self.verb == "diagnose" else {}),
                "joints": row.joints,
                "missing": "; ".join(row.missing),
                "warnings": " ".join(row.warnings),
                "failed": row.failed,
                "page": row.page,
            }
            for row in self.rows
        ).astype(dict.fromkeys(("parameters", *kinds), "Int64"))

    def to_dict(self) -> dict[str, Any]:
        """Return the answers in their documented JSON schema."""
        return {
            "schema": self.schema,
            "name": self.name,
            "verb": self.verb,
            "statement": self.statement,
            "robots": [{**asdict(row), "page": row.page} for row in self.rows],
        }


StudyLike = Annotated[
    str | Path | Mapping[str, Any],
    Expected("the path of a study's TOML file, or a mapping of what stands in it"),
]


@checked
def batch(
    study: StudyLike,
    out: FilePath | None = None,
    *,
    engine: Engine | None = None,
    progress: Progress | None = None,
) -> Batch:
    """Ask the same of many robots: one table, and a page each.

    Whoever asks again gets what is finished from the folder; a robot, log, option or program that
    is another one is asked anew, as is a robot that failed.

    Parameters
    ----------
    study : path or mapping
        TOML with a ``verb``, its ``options`` and ``[[robots]]``, as `StudyEntry` describes it.
    out : path, optional
        Folder of the answers: new, empty, or that of an earlier time. By default
        ``<study>-results`` beside the file.
    engine : Engine, optional
        Where robots are asked; by default in several processes.
    progress : callable(str, float), optional

    Raises
    ------
    IdentifiabilityError
        If the study or the folder cannot be used; what is wrong with one robot stands in its row.
    """
    say = progress or (lambda _text, _share: None)
    if isinstance(engine, Resumed):
        raise OptionError("A batch keeps finished work in its own folder; leave resume out.")
    entry, start, name = _read(study)
    folder = Path(out) if out is not None else start / f"{name}-results"
    if out is None and not isinstance(study, (str, Path)):
        raise OptionError("A study that is no file needs a folder for its answers; give out.")
    say("looking at robots and logs", 0.0)
    tasks = plan_tasks(entry, start)
    with _kept(folder) as (stream, finished), nullcontext(engine) if engine else Processes() as run:
        keys = [fingerprint(run_task, task) for task in tasks]
        before = ((t.name, finished.get(k)) for t, k in zip(tasks, keys, strict=True))
        rows = {name: row for name, row in before if row is not None and _is_whole(folder, row)}
        missing = [(t, k) for t, k in zip(tasks, keys, strict=True) if t.name not in rows]
        found = len(rows)
        answers = run.map(run_task, [task for task, _ in missing])
        for (task, key), answer in zip(missing, answers, strict=True):
            rows[task.name] = row = answer.row
            if not row.failed:
                write_bytes(folder / ROBOTS / f"{row.robot}.json", answer.json)
                write_bytes(folder / row.page, answer.page)
                _note(stream, {"key": key, "row": asdict(row)})
            say(f"asked {task.name}", len(rows) / len(tasks))
        in_order = tuple(rows[task.name] for task in tasks)
        source = "" if isinstance(study, Mapping) else str(study)
        result = Batch(
            name=name, verb=entry.verb, folder=folder, rows=in_order, found=found, study=source
        )
        write_table(folder / TABLE, result.to_frame())
        result.to_json(folder / Path(TABLE).with_suffix(".json"))
        result.write_report(folder / PAGE)
    return result


def _read(study: str | Path | Mapping[str, Any]) -> tuple[StudyEntry, Path, str]:
    """Return a study, the folder in which its paths begin, and its name."""
    if isinstance(study, (str, Path)):
        path = Path(study)
        return read_document(path, StudyEntry, "TOML", "study", OptionError), path.parent, path.stem
    try:
        return StudyEntry.model_validate(dict(study)), Path(), "study"
    except ValidationError as error:
        raise OptionError(f"The study: {first_problem(error, StudyEntry)}") from None


@contextmanager
def _kept(folder: Path) -> Iterator[tuple[IO[str], dict[str, Row]]]:
    """Give the file to which finished robots are added, held against others, and what it has.

    Raises
    ------
    OutputError
        If the folder is none, has other things in it, or another program works in it.
    """
    try:
        path = folder / FINISHED
        if folder.is_dir() and any(folder.iterdir()) and not path.is_file():
            raise OutputError(
                f"'{folder}' is there already and no batch made it; give a new folder (--out)."
            )
        (folder / ROBOTS).mkdir(parents=True, exist_ok=True)
        with path.open("a+", encoding="utf-8") as stream:
            if sys.platform != "win32":
                try:
                    fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    raise OutputError(
                        f"Another batch is at work in '{folder}'; wait for it, or give another "
                        "folder (--out)."
                    ) from None
                except OSError:  # a file system without locks
                    pass
            stream.seek(0)
            text = stream.read()
            if text and not text.endswith("\n"):  # a line that was cut off
                stream.write("\n")
            yield stream, dict(_read_finished(text))
    except OSError as error:
        raise OutputError(f"'{folder}' cannot be used: {error.strerror or error}.") from None


def _read_finished(text: str) -> Iterator[tuple[str, Row]]:
    """Yield finished robots by their keys; lines that are damaged are left out."""
    for line in text.splitlines():
        with suppress(ValueError, KeyError, TypeError):
            content = json.loads(line)
            row = content["row"]
            lists = {name: tuple(row[name]) for name in ("missing", "warnings")}
            yield content["key"], Row(**{**row, **lists})


def _is_whole(folder: Path, row: Row) -> bool:
    return (folder / row.page).is_file() and (folder / ROBOTS / f"{row.robot}.json").is_file()


def _note(stream: IO[str], content: Mapping[str, Any]) -> None:
    """Add a line to what is finished, for good."""
    stream.write(json.dumps(content, ensure_ascii=False) + "\n")
    stream.flush()
    os.fsync(stream.fileno())


def _done(result: Batch) -> Answer:
    done, total = len(result.done), len(result.rows)
    names = listing([row.robot for row in result.failed])
    short = f"Yes, all {total}." if done == total else f"{done} of {total}."
    text = f"Without one: {names}; why is said below." if names else ""
    return Answer("Has every robot an answer?", short, text, "amber" if names else "green")


def _errors(result: Batch) -> Answer:
    question, worst = "How well is unseen motion predicted?", result.worst
    if not worst:
        return Answer(question, "Not known.", tone="grey")
    errors = [row.unseen for row in worst]
    ends = dict.fromkeys((percent(errors[0], 2), percent(errors[-1], 2)))
    short = f"With an error of {' to '.join(ends)}."
    named = [f"{row.robot} ({percent(row.unseen, 2)})" for row in worst[:3]]
    text = f"Half of them err by at most {percent(errors[len(errors) // 2], 2)}."
    return Answer(question, short, f"{text} The largest: {listing(named)}.", "blue")


def _check(result: Batch) -> Answer:
    lacking = [row.robot for row in result.done if row.missing]
    warned = [row.robot for row in result.done if row.warnings]
    parts = [
        f"Something is missing in the model of {listing(lacking)}." if lacking else "",
        f"There are warnings on {listing(warned)}." if warned else "",
    ]
    count = len({*lacking, *warned})
    short = f"{format_count(count, 'robot')} first." if count else "Nothing stands out."
    tone = "amber" if count else "green"
    return Answer("Which should I look at?", short, " ".join(filter(None, parts)), tone)


def _next(result: Batch) -> Answer:
    study, folder = quote(result.study or "study.toml"), quote(str(result.folder))
    when = "these are mended" if result.failed else "there are more robots or logs"
    line = f"identifiability batch {study} --out {folder}"
    commands = [(f"When {when}, the same (what is finished is not done again):", line)]
    if result.verb != "diagnose" and any(row.missing for row in result.done):
        text = 'Name what is missing, in a copy of the study with verb = "diagnose":'
        commands.append((text, "identifiability batch missing.toml --out missing"))
    return answer_next(commands)


def _link(row: Row) -> Cell:
    return Cell(row.robot, row.robot, note=row.file, link=quote_link(row.page))


def _count(kind: str) -> Column:
    def of(row: Row) -> object:
        return row.verdicts.get(kind, 0) if row.verdicts else None

    return Column(kind, "number", of)


def _error(title: str, name: str, note: str = "") -> Column:
    def of(row: Row) -> Cell:
        error, below = getattr(row, name), getattr(row, note) if note else ""
        return Cell(NONE, float("nan")) if error is None else Cell(error_text(error), error, below)

    return Column(title, "number", of)
