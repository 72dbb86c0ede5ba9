"""What a command looks at before anything large is imported: are files there, can they be written?

An option says by a mark beside it what its value is: `Reads` and `Writes`. Names of other options
that take logs are in `LOGS`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any

from identifiability.cli.common import check_outputs, sentences

#: Options that are logs to read.
LOGS = ("logs", "validate", "loaded", "start_from", "without")

#: Options that are logs, or results.
SIDES = ("before", "after", "more_before", "more_after")

#: Endings of documents, which no folder has.
DOCUMENTS = (
    ".html",
    ".pdf",
    ".json",
    ".csv",
    ".parquet",
    ".xlsx",
    ".txt",
    ".toml",
    ".xml",
    ".urdf",
)


@dataclass(frozen=True)
class Reads:
    """Marks an option as a document that is read: what it is, its format, and whether it must be.

    Where it need not be, words without the format's ending mean something else.
    """

    what: str
    form: str
    always: bool = True

    def check(self, value: str | Path) -> None:
        """Refuse a path where no document is.

        Raises
        ------
        OptionError
        """
        from identifiability.foundation.options import OptionError  # noqa: PLC0415

        path = Path(value)
        meant = self.always or path.suffix.lower() == f".{self.form.lower()}"
        if meant and not path.exists():
            raise OptionError(f"There is no {self.what} file '{value}'; give a {self.form} file.")


@dataclass(frozen=True)
class Writes:
    """Marks an option as a file that is written, with its endings; without any, as a folder."""

    endings: tuple[str, ...]

    def __init__(self, *endings: str) -> None:
        object.__setattr__(self, "endings", endings)

    def check(self, path: Path) -> None:
        """Refuse a name that ends as if it were of another format.

        Raises
        ------
        OutputError
        """
        from identifiability.foundation.errors import OutputError  # noqa: PLC0415
        from identifiability.foundation.output import check_ending  # noqa: PLC0415

        if self.endings:
            check_ending(path, *self.endings)
        elif path.is_file() or path.suffix.lower() in DOCUMENTS:
            raise OutputError(f"'{path}' is the name of a file; give that of a folder.")


def look(
    given: Mapping[str, Any], marks: Mapping[str, tuple[Any, ...]], *, motion_alone: bool = False
) -> None:
    """Refuse what is not there or cannot be written, and logs with other columns, in no time.

    Parameters
    ----------
    given : mapping
        What was typed: options by name, and groups of options.
    marks : mapping
        `Reads` and `Writes` by the name of the option, those of groups among them.
    motion_alone : bool
        Logs of motion alone have no torque.
    """
    flat = dict(given)
    for group in filter(is_dataclass, given.values()):
        flat |= {name: getattr(group, name) for name in marks if hasattr(group, name)}
    machine, recorded = given.get("machine"), given.get("recorded")
    logs = [path for name in LOGS for path in flat.get(name) or ()]
    sides = [path for name in SIDES for path in _several(flat.get(name))]
    results = [path for path in sides if path.lower().endswith(".json")]
    logs += [path for path in sides if path not in results]
    with sentences():
        read = [*(() if machine is None else (machine.robot, machine.sidecar)), *logs, *results]
        marked = list(_marked(flat, marks))
        read += [value for mark, value in marked if isinstance(mark, Reads)]
        written = [(mark, Path(value)) for mark, value in marked if isinstance(mark, Writes)]
        check_outputs(*(path for mark, path in written if mark.endings), inputs=read)
        for ends, path in written:
            ends.check(path)
        robot = given.get("robot") if machine is None else machine.robot
        if robot is not None:
            from identifiability.robot.locate import locate_robot  # noqa: PLC0415

            locate_robot(robot)
        for mark, value in marked:
            if isinstance(mark, Reads):
                mark.check(value)
        for result in results:
            Reads("result", "JSON").check(result)
        _look_at_logs(logs, machine, recorded, motion_alone=motion_alone)


def _marked(
    given: Mapping[str, Any], marks: Mapping[str, tuple[Any, ...]]
) -> Iterable[tuple[Reads | Writes, Any]]:
    for name, several in marks.items():
        for mark in several:
            if given.get(name) is not None:
                yield mark, given[name]


def _several(value: Any) -> list[str]:
    return [value] if isinstance(value, str) else list(value or ())


def _look_at_logs(logs: list[str], machine: Any, recorded: Any, *, motion_alone: bool) -> None:
    """Refuse logs that are not there, and tables whose columns are none of the robot's."""
    from identifiability.logs.bags import check_there  # noqa: PLC0415

    for path in logs:
        check_there(Path(path))
    tables = [Path(name) for name in logs if name.lower().endswith(".csv")]
    if tables and machine is not None and recorded is not None:
        from identifiability.logs.conventions import Conventions  # noqa: PLC0415
        from identifiability.logs.source import check_header  # noqa: PLC0415

        known = replace(Conventions.of(machine.load(recorded)), motion_alone=motion_alone)
        for table in tables:
            check_header(table, known)
