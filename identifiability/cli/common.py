"""What the commands share: sentences instead of tracebacks, progress, checks, tables.

And a first look before anything large is imported: are files there, can they be written?
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal, NoReturn
from unicodedata import category

from identifiability.foundation.errors import IdentifiabilityError, legible

if TYPE_CHECKING:
    from identifiability.foundation.answers import Table
    from identifiability.foundation.result import Result


# What the commands share: sentences instead of tracebacks, progress, checks, tables.


#: No plain line of progress in the first seconds; one for the same stage after so many [s].
QUIET, AGAIN = 2.0, 15.0


@contextmanager
def sentences() -> Iterator[None]:
    """Turn the library's errors into one line on standard error and exit code 2, 130 for Ctrl-C."""
    try:
        yield
    except IdentifiabilityError as error:
        _fail(str(error))
    except BrokenPipeError:  # the reader of our output went away; typer knows what to do
        raise
    except OSError as error:
        what = f"'{error.filename}' cannot be used" if error.filename else "The system refused"
        _fail(legible(f"{what}: {error.strerror or error}."))
    except MemoryError:
        _fail(
            "There is not enough memory for this. Joints and effects take it, and logs that are "
            "held as a whole: lock joints that are not asked about (--lock), name fewer effects, "
            "give shorter stretches, or a CSV or Parquet file, which is read piece by piece."
        )
    except KeyboardInterrupt:
        sys.stderr.write("Stopped; no file was left half-written.\n")
        raise SystemExit(130) from None


def _fail(sentence: str) -> NoReturn:
    from rich.console import Console  # noqa: PLC0415

    Console(stderr=True).print(
        f"[red]Error:[/] {escaped(sentence)}", highlight=False, soft_wrap=True
    )
    raise SystemExit(2) from None


def escaped(text: str) -> str:
    """Return text in which rich finds no markup, and a terminal no command."""
    from rich.markup import escape  # noqa: PLC0415

    return escape(harmless(text))


def harmless(text: str) -> str:
    """Return text whose control characters are shown instead of obeyed; lines stay lines."""
    return "".join(
        repr(c)[1:-1] if category(c) in ("Cc", "Cf", "Zl", "Zp") and c not in "\n\t" else c
        for c in text
    )


class Lines:
    """Progress for who reads a file or a pipe: a line for every stage after the first seconds.

    What is refused is refused while logs are read: of the first stage there is no line.

    Parameters
    ----------
    write : callable(str)
    clock : callable() -> float [s], optional
    """

    def __init__(
        self, write: Callable[[str], object], clock: Callable[[], float] = monotonic
    ) -> None:
        self._write, self._clock = write, clock
        self._start = self._told = clock()
        self._first, self._text = "", ""

    def __call__(self, text: str, share: float) -> None:
        """Say how far a stage is, if it is another one or long was silence."""
        now = self._clock()
        self._first = self._first or text
        if (
            text == self._first
            or now - self._start < QUIET
            or (text == self._text and now - self._told < AGAIN)
        ):
            return
        self._text, self._told = text, now
        self._write(f"{100 * min(max(share, 0.0), 1.0):3.0f} %  {text}\n")


@contextmanager
def progress(*, show: bool = True) -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on a terminal, and plain lines elsewhere; give a callback (what, share).

    Both go to standard error.
    """
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    if show and not console.is_terminal:
        yield Lines(sys.stderr.write)
        return
    with Progress(*columns, console=console, transient=True, disable=not show) as bar:
        task = bar.add_task("starting", total=1.0)

        def say(text: str, share: float) -> None:
            bar.update(task, description=text, completed=share)

        yield say


def check_outputs(*paths: Path | None, inputs: Iterable[str | Path | None] = ()) -> None:
    """Refuse paths that cannot be written, or are inputs, before a long computation starts."""
    from identifiability.foundation.output import check_apart, check_writable  # noqa: PLC0415

    outputs = [check_writable(path) for path in paths if path is not None]
    check_apart(outputs, [path for path in inputs if path is not None])


#: Rows of a table that are listed.
LISTED = 12


def print_table(title: str, shown: Table) -> None:
    """Print a table of a result under its title."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table as Grid  # noqa: PLC0415

    console, grid = Console(), Grid()  # a title of its own would be wrapped to its width
    for column in shown.columns:
        side: Literal["left", "right"] = "right" if column.kind in ("number", "bar") else "left"
        grid.add_column(column.title, justify=side, overflow="fold")  # no name is cut
    for at, row in enumerate(shown.rows):
        first = "▸ " if at == shown.marked else ""
        grid.add_row(*(escaped(f"{first * (not k)}{cell.text}") for k, cell in enumerate(row)))
    if not console.is_terminal:  # a file, or another program, has no width
        console.width = 10_000
    console.print(f"[italic]{escaped(title)}[/italic]", soft_wrap=True)
    console.print(grid)


def print_result(
    result: Result,
    texts: Iterable[str] = (),
    written: Sequence[Path] = (),
    title: str = "",
    most: int | None = None,
) -> None:
    """Print the tables of a result, sentences, what to do next, and the paths of what was written.

    Parameters
    ----------
    result : Result
    texts : iterable of str
    written : sequence of Path
    title : str
        Of the first table; others have their captions.
    most : int, optional
        Rows of the first table.
    """
    from identifiability.foundation.rounding import format_count  # noqa: PLC0415

    tables = (*result.tables(), *result.ledger())
    for at, table in enumerate(t for t in tables if not t.long):
        caption = title if title and not at else table.caption
        shown = LISTED if at or most is None else most
        print_table(caption, table.brief(shown))
        if (more := len(table.rows) - shown) > 0:
            which = "with smaller errors" if table.worst is not None else "below them"
            where = "the page" if any(p.suffix == ".html" for p in written) else "--report"
            print_end([f"{format_count(more, 'row')} {which}: {where} shows them all."])
    print_end(texts)
    print_next(result)
    print_end([], written)


def apart(statement: str, hints: Sequence[str]) -> list[str]:
    """Return a statement that ends in hints as the answer and each hint by itself."""
    return [statement.removesuffix(" ".join(hints)).strip(), *hints]


def print_next(result: Result) -> None:
    """Print what the page proposes first, with the line to type."""
    from rich.console import Console  # noqa: PLC0415

    for what, command in result.next()[:1]:
        line = f"{what[0].lower()}{what[1:]} {command}"
        Console().print(f"[bold]Next[/bold] {escaped(line)}", highlight=False, soft_wrap=True)


def print_end(texts: Iterable[str], written: Iterable[Path] = ()) -> None:
    """Print what is said last: sentences, and the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415

    console = Console()
    for text in texts:
        console.print(escaped(text), highlight=False, soft_wrap=not console.is_terminal)
    for path in written:
        sys.stdout.write(f"{path}\n")


# What a command looks at before anything large is imported: are files there, can they be written?
#
# An option says by a mark beside it what its value is: `Reads` and `Writes`. Names of other
# options that take logs are in `LOGS`.


#: Options that are logs to read.
LOGS = ("logs", "validate", "loaded", "start_from", "without", "fit")

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
    given: Mapping[str, Any],
    marks: Mapping[str, Sequence[Any]],
    machine: Any,
    recorded: Any,
    *,
    motion_alone: bool = False,
) -> None:
    """Refuse what is not there or cannot be written, and logs with other columns, in no time.

    Parameters
    ----------
    given : mapping
        What was typed, by the name of the option.
    marks : mapping
        What stands beside them, `Reads` and `Writes` among it.
    machine, recorded : Machine, Recorded or None
        Groups that say of which robot the logs are.
    motion_alone : bool
        Logs of motion alone have no torque.

    Raises
    ------
    IdentifiabilityError
    """
    logs = [path for name in LOGS for path in given.get(name) or ()]
    sides = [path for name in SIDES for path in _several(given.get(name))]
    results = [path for path in sides if path.lower().endswith(".json")]
    logs += [path for path in sides if path not in results]
    marked = list(_marked(given, marks))
    robot = given.get("robot") or None
    read = [robot, given.get("sidecar"), *logs, *results]
    read += [value for mark, value in marked if isinstance(mark, Reads)]
    written = [(mark, Path(value)) for mark, value in marked if isinstance(mark, Writes)]
    check_outputs(*(path for mark, path in written if mark.endings), inputs=read)
    for ends, path in written:
        ends.check(path)
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
    given: Mapping[str, Any], marks: Mapping[str, Sequence[Any]]
) -> Iterable[tuple[Reads | Writes, Any]]:
    for name, several in marks.items():
        for mark in several:
            if isinstance(mark, (Reads, Writes)) and given.get(name) is not None:
                yield mark, given[name]


def _several(value: Any) -> list[str]:
    return [value] if isinstance(value, str) else list(value or ())


def _look_at_logs(logs: list[str], machine: Any, recorded: Any, *, motion_alone: bool) -> None:
    """Refuse logs that are not there, and tables whose columns are none of the robot's."""
    from identifiability.logs.formats.reader import check_there  # noqa: PLC0415

    for path in logs:
        check_there(Path(path))
    tables = [Path(name) for name in logs if name.lower().endswith(".csv")]
    if tables and machine is not None and recorded is not None:
        from identifiability.logs.conventions import Conventions  # noqa: PLC0415
        from identifiability.logs.source import check_header  # noqa: PLC0415

        known = replace(Conventions.of(machine.load(recorded)), motion_alone=motion_alone)
        for table in tables:
            check_header(table, known)
