"""One verb over many robots: one table, and a page each; failures are sentences in the table.

Each robot is one item of an engine. Its answer does not depend on where it was computed.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_type_hints

from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.errors import IdentifiabilityError, OutputError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.options import FilePath, OptionError, check_option, checked
from identifiability.foundation.output import temporary_folder, write_bytes
from identifiability.foundation.result import Result
from identifiability.foundation.runs import Progress, quiet, running
from identifiability.foundation.values import Fields, Json, frozen
from identifiability.foundation.wording import at_terminal
from identifiability.logs.prepare import Preparation
from identifiability.logs.tables import is_log_file, write_table
from identifiability.robot.locate import ENDINGS
from identifiability.robot.sidecar import read_settings

from .analyze import analyze
from .diagnose import diagnose
from .prune import prune

Verb = Literal["analyze", "prune", "diagnose"]

#: Files in the folder of the answers.
PAGE, TABLE, JSON, ROBOTS = "index.html", "table.csv", "table.json", "robots"


def _find(folder: Path) -> tuple[Path, list[Path], list[Path]]:
    """Return the robot file in a folder, its logs, and the last of several, which is held out.

    Raises
    ------
    OptionError
        If there is no folder, no log, or not one robot file.
    """
    if not folder.is_dir():
        raise OptionError(Finding("fleet.none", folder.name))
    there = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    files = [path for path in there if path.suffix.lower() in ENDINGS]
    files = [p for p in files if p.name in ("robot.xml", "robot.urdf")][-1:] or files
    if len(files) != 1:
        has = f"has {listing([p.name for p in files])}" if files else "has no robot file"
        raise OptionError(f"'{folder.name}' {has}; there must be one robot.urdf or robot.xml.")
    logs = [path for path in there if is_log_file(path)]
    if not logs:
        raise OptionError(Finding("fleet.logs", folder.name))
    fitted = logs[:-1] or logs
    return files[0], fitted, logs[len(fitted) :]


def _digest(folder: Path, options: Mapping[str, Any]) -> str:
    """Return a digest of the content of all files that lead to an answer."""
    digest = hashlib.sha256()
    for place in (folder, *(Path(v) for v in options.values() if isinstance(v, (str, Path)))):
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.is_file():
                digest.update(path.name.encode())
                with path.open("rb") as stream:
                    digest.update(hashlib.file_digest(stream, "sha256").digest())
    return digest.hexdigest()


VERBS: Fields = {"analyze": analyze, "prune": prune, "diagnose": diagnose}


def _check_options(verb: str, given: Mapping[str, Any]) -> None:
    """Refuse unknown options of a verb."""
    kinds = get_type_hints(VERBS[verb], include_extras=True)
    for name, value in given.items():
        if name not in kinds:
            raise OptionError(f"'{name}' is no option of {verb}{near_match(name, kinds)}")
        check_option(name, value, kinds[name])


#: Table entries of a robot that has no answer yet.
EMPTY: Fields = {
    "robot": "",
    "logs": [],
    "held": [],
    "model": "",
    "parameters": None,
    "verdicts": {},
    "error": None,
    "error_unseen": None,
    "missing": [],
    "warnings": [],
    "failed": "",
    "page": "",
}


def run_task(
    verb: str, options: Mapping[str, Any], task: tuple[Path, str]
) -> tuple[Fields, bytes, bytes]:
    """Return the table row of a robot, its JSON and its page; the row states any error.

    Parameters
    ----------
    verb : str
    options : mapping
    task : (Path, str)
        Its folder, with the digest of all inputs of an answer.
    """
    name = task[0].name
    own = dict(options)
    row = {**EMPTY, "robot": name}
    try:
        robot, fitted, held = _find(task[0])
        row |= {"logs": [p.name for p in fitted], "held": [p.name for p in held]}
        stated = read_settings(robot)["preparation"]
        if stated and own.get("preparation") is None:
            own["preparation"] = Preparation(**stated)
        result: Result = VERBS[verb](robot, fitted, held, engine=Serial(), **own)
        with temporary_folder() as folder:
            told = result.to_json(Path(folder, f"{name}.json")).read_bytes()
            page = result.write_report(Path(folder, f"{name}.html")).read_bytes()
            # Files move to their place, which their lines to type shall name.
            here, there = f"{folder}/".encode(), f"{ROBOTS}/".encode()
            told, page = told.replace(here, there), page.replace(here, there)
        return row | _state(json.loads(told)) | {"page": f"{ROBOTS}/{name}.html"}, told, page
    except IdentifiabilityError as error:
        with at_terminal():  # the table is a file
            said = str(error)
    except MemoryError:  # of all that run at once: the whole run says so
        raise
    except Exception as error:  # noqa: BLE001 - one robot does not end the others
        said = f"It met a fault of this program, please report it: {type(error).__name__}: {error}."
    return row | {"failed": said}, b"", b""


def _state(told: Mapping[str, Any]) -> Json:
    """Return the table entries of a result from its JSON."""
    if "models" not in told:  # a diagnosis
        effects = ((" or ".join([e["effect"], *e["or"]]), e["joints"]) for e in told["effects"])
        chosen = told["after"]
        names = told["fit"]["names"]
        verdicts = Counter[str]()
        chosen["name"] = told["fit"]["model"]["name"]
        missing = [f"{name}@{', '.join(at)}".rstrip("@") for name, at in effects]
    else:
        chosen = next(m for m in told["models"] if m["name"] == told["selected"])
        names = told["parameters"]
        verdicts = Counter(p["verdict"] for p in told["parameters"])
        missing = [f"{f['of']}, {f['joint']}" for f in told["missing_functions"]]
    return {
        "model": chosen["name"],
        "parameters": len(names),
        "verdicts": dict(verdicts),
        "error": chosen["error_ra"],
        "error_unseen": chosen["error_ra_validation"],
        "missing": missing,
        "warnings": told["hints"],
    }


@frozen(kw_only=True)
class Fleet(Result):
    """The answers of many robots. Make it with `analyze_many`.

    Attributes
    ----------
    verb : str
    folder : Path
        Where the table and the pages are.
    rows : tuple of mapping
        One a robot. Its entries are the names of fitted and held-out logs (``held``), the model to
        use (for a diagnosis with the missing effects), and the number of parameters by verdict.
        Then follow relative errors on fitted and unseen motion, missing effects, hints, the page,
        and the reason if there is no answer (``failed``).
    """

    schema = "identifiability/fleet/1"

    verb: str
    folder: Path
    rows: tuple[Mapping[str, Any], ...]

    @property
    def files(self) -> list[Path]:
        """The table, as CSV and as JSON, and its page."""
        return [self.folder / name for name in (TABLE, JSON, PAGE)]

    @property
    def failed(self) -> dict[str, str]:
        """Robots without an answer, with the reason."""
        return {row["robot"]: row["failed"] for row in self.rows if row["failed"]}

    def to_dict(self) -> Json:
        """Return the answers in their documented JSON schema."""
        head = {"schema": self.schema, "verb": self.verb, "statement": self.statement}
        return {**head, "robots": [dict(row) for row in self.rows]}


@checked
def analyze_many(
    robots: Sequence[FilePath],
    out: FilePath,
    verb: Verb = "analyze",
    *,
    engine: Engine | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Fleet:
    """Run one verb on many robots: one table, and a page each.

    Parameters
    ----------
    robots : sequence of path
        Folders, each with a robot file (``robot.xml``, ``robot.urdf`` or the only one), its sidecar
        and its logs, of which the last of several, by name, is held out.
    out : path
        Folder of the answers: new, empty, or that of an earlier time.
    verb : {"analyze", "prune", "diagnose"}
    engine : Engine, optional
        Where the verb runs; by default in several processes.
    progress : callable(str, float), optional
    **options
        Of the verb.

    Raises
    ------
    IdentifiabilityError
        If options or the folder cannot be used; errors of a single robot are stated in its row.
    """
    say = progress or quiet
    folder = Path(out)
    _check_options(verb, options)
    places = [Path(place).resolve() for place in robots]
    if not places:
        raise OptionError("No robot is given; give folders with a robot file and logs.")
    names = Counter(place.name.casefold() for place in places)
    name, count = names.most_common(1)[0]
    if count > 1:
        raise OptionError(f"Two robots are called '{name}'; rename the folder of one.")
    say("looking at robots and logs", 0.0)
    tasks = [(place, _digest(place, options)) for place in places]
    _open(folder)
    rows: list[Json] = []
    with running(engine) as runner:
        for row, told, page in runner.map(partial(run_task, verb, options), tasks):
            rows.append(row)
            if page:
                write_bytes(folder / ROBOTS / f"{row['robot']}.json", told)
                write_bytes(folder / row["page"], page)
            say(f"asked {row['robot']}", len(rows) / len(tasks))
    result = Fleet(verb=verb, folder=folder, rows=tuple(rows))
    write_table(folder / TABLE, result.to_frame(details=True))
    result.to_json(folder / JSON)
    result.write_report(folder / PAGE)
    return result


def _open(folder: Path) -> None:
    """Make the folder of the answers.

    Raises
    ------
    OutputError
        If it is no folder, or holds other files.
    """
    try:
        there = list(folder.iterdir()) if folder.exists() else []
        if there and not (folder / JSON).is_file():
            raise OutputError(Finding("fleet.other", folder, name=there[0].name))
        (folder / ROBOTS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"'{folder}' cannot be used: {error.strerror or error}.") from None
