"""What the commands share: sentences instead of tracebacks, progress, tables, files of results."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from time import monotonic
from typing import TYPE_CHECKING, Literal, NoReturn
from unicodedata import category

from identifiability.foundation.errors import IdentifiabilityError, OutputError, legible

if TYPE_CHECKING:
    from identifiability.foundation.answers import Table
    from identifiability.foundation.result import Result


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

    for at, table in enumerate(t for t in result.tables() if not t.long):
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


# Results are written where they should be, or else elsewhere.


def write_all(*asked: tuple[Callable[[Path], Path], Path | None]) -> list[Path]:
    """Call functions that write with their paths, and return these; those of no path are not asked.

    Raises
    ------
    OutputError
        If something cannot be written where it should, after all others were written.
    """
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


def _write(write: Callable[[Path], Path], path: Path) -> Path:
    """Write a result; where that fails, as on a full disk, write it elsewhere and say where."""
    try:
        return write(path)
    except OutputError as error:
        from identifiability.foundation.output import FOLDER, FOLDERS_STAY  # noqa: PLC0415

        elsewhere = Path(mkdtemp(prefix=f"{FOLDER}rescued-")) / path.name
        try:
            write(elsewhere)
        except BaseException as again:  # also Ctrl-C
            rmtree(elsewhere.parent, ignore_errors=True)
            if isinstance(again, OutputError):
                raise error from None
            raise
        raise OutputError(
            f"{error} What was found is not lost: it is in '{elsewhere}', for {FOLDERS_STAY} days."
        ) from None
