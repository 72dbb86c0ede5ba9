"""Shared by the commands: one-sentence errors, progress, tables, paths of results."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from shutil import rmtree, which
from tempfile import mkdtemp
from time import monotonic
from typing import TYPE_CHECKING, Literal, NoReturn

from identifiability.foundation.errors import IdentifiabilityError, OutputError, legible
from identifiability.foundation.findings import Finding
from identifiability.foundation.quoting import for_terminal, path_for_shell
from identifiability.foundation.wording import at_terminal

from .case import shorten_line

if TYPE_CHECKING:
    from rich.console import Console

    from identifiability.foundation.answers import Table
    from identifiability.foundation.result import Result
    from identifiability.foundation.runs import Progress

#: Writes a result to a path, and returns the path.
Write = Callable[[Path], Path]

#: Work without a terminal reports its remaining time if it is longer than this [s].
PATIENCE = 10.0

#: Whether all details are printed.
VERBOSE = ContextVar("VERBOSE", default=False)


@contextmanager
def sentences() -> Iterator[None]:
    """Turn the library's errors into one line on standard error and exit code 2, 130 for Ctrl-C.

    Remedies name options of the command line.
    """
    with at_terminal():
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
            _fail(Finding("memory"))
        except KeyboardInterrupt:
            sys.stderr.write("Stopped; no file was left half-written.\n")
            raise SystemExit(130) from None


def _fail(sentence: str) -> NoReturn:
    shown = for_terminal(sentence, keep="\n\t")
    sys.stderr.write(f"Error: {shown}\n")
    raise SystemExit(2) from None


def escaped(text: str) -> str:
    """Return text without markup for rich and without control characters for a terminal."""
    from rich.markup import escape  # noqa: PLC0415

    return escape(for_terminal(text, keep="\n\t"))


def terminal(*, stderr: bool = False) -> Console:
    """Return the terminal, which prints ``:x:`` in a name literally."""
    from rich.console import Console  # noqa: PLC0415

    return Console(stderr=stderr, emoji=False)


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a progress bar on standard error; yield a callback (step, share).

    Without a terminal, a line reports the remaining time of a long computation every half minute.
    """
    from rich import progress as bars  # noqa: PLC0415

    console = terminal(stderr=True)
    columns = (bars.TextColumn("{task.description}"), bars.BarColumn())
    hidden = not console.is_terminal
    with bars.Progress(*columns, console=console, transient=True, disable=hidden) as bar:
        task = bar.add_task("starting", total=1.0)

        begun = monotonic()
        printed = -math.inf

        def say(text: str, share: float) -> None:  # never backwards
            nonlocal printed
            share = max(share, bar.tasks[0].completed)
            past = monotonic() - begun
            left = past * (1 - share) / share if share >= 0.05 else 0.0  # before it is a guess
            is_long = past > 3.0 and left > PATIENCE
            timed = f"{text} (all: about {left:.0f} s more)" if is_long else text
            bar.update(task, description=timed, completed=share)
            if hidden and is_long and past - printed > 3 * PATIENCE:
                printed = past
                console.print(timed, highlight=False)

        yield say


def check_outputs(*paths: Path | None, inputs: Iterable[str | Path | None] = ()) -> None:
    """Refuse paths that cannot be written, or are inputs, before a long computation starts."""
    from identifiability.foundation.output import check_apart, check_writable  # noqa: PLC0415

    outputs = [check_writable(path) for path in paths if path is not None]
    check_apart(outputs, [path for path in inputs if path is not None])


def print_table(shown: Table, rows: int, title: str, quantity: Callable[[str], str]) -> None:
    """Print a table of a result with at most `rows` rows, under its caption or a title.

    `quantity` names torque, or force where all joints slide.
    """
    from rich.table import Table as Grid  # noqa: PLC0415

    # rich would wrap a title of the table to its width
    console = terminal()
    grid = Grid()
    own = shown.brief(rows)
    for column in own.columns:
        side: Literal["left", "right"] = "right" if column.kind in ("number", "bar") else "left"
        grid.add_column(quantity(column.title), justify=side, overflow="fold")  # no name is cut
    for at, row in enumerate(own.rows):
        first = "▸ " if at == own.marked else ""
        grid.add_row(*(escaped(f"{first * (not k)}{cell.text}") for k, cell in enumerate(row)))
    if not console.is_terminal:  # a file, or another program, has no width
        console.width = 10_000
    marks = " (▸ use this one)" if own.marked is not None else ""
    title = escaped(quantity(own.caption or title))
    console.print(f"[italic]{title}{marks}[/italic]", soft_wrap=True)
    console.print(grid)


def print_result(result: Result, written: Sequence[Path] = (), more: Iterable[str] = ()) -> None:
    """Print short answers, warnings, the next step and written files; with -v all details.

    Parameters
    ----------
    result : Result
    written : sequence of Path
    more : iterable of str
        Further sentences, below the answers.
    """
    from identifiability.foundation.rounding import format_count  # noqa: PLC0415
    from identifiability.report.answers.common import name_forces, pushes  # noqa: PLC0415

    quantity = name_forces if pushes(result) else str
    answers = [a for a in result.answers() if not a.commands]
    every = VERBOSE.get()
    page = any(p.suffix == ".html" for p in written)
    said = [f"{a.question} {a.whole if every else a.short}" for a in answers]
    warnings = [quantity(f"Warning: {text}") for text in result.warnings]
    shorts = [a.short for a in answers]
    told = [x for x in result.remarks if isinstance(x, Finding) and x.told and not every]
    # An answer that leads with a finding begins it with a small letter.
    led = [x for x in told if any(x[1:] in short for short in shorts)]
    choices = [f"Note: {x}" for x in told if x not in led]
    said = [*said, *warnings, *choices] if said else [result.statement]
    hints = [x for x in result.remarks if x not in told]
    print_end([*said, *more])
    title = getattr(getattr(result, "robot", None), "title", "")
    for table in (*result.tables(), *result.ledger()):
        if table.long or not table.rows or not (every or not answers or table.always):
            continue
        shown = max(12, (table.marked or 0) + 4)
        print_table(table, shown, title, quantity)
        if (left := len(table.rows) - shown) > 0:
            where = "the page" if page else "--report"
            print_end([f"{format_count(left, 'row')} below them: {where} shows them all."])
    where = "the page" if page else "-v"  # which would repeat a long run
    brief = [f"{format_count(len(hints), 'hint')}: see {where}."] if hints else []
    print_end(hints if every else brief)
    print_next(result)
    print_end([], written)


def print_next(result: Result) -> None:
    """Print the first line that the page proposes.

    If `identifiability` is not on the search path, the line first activates its environment. This
    happens after ``make demo``. In the folder of a case the line has no words of the case file.
    """
    script = Path(sys.argv[0])
    activate = script.with_name("activate")
    alone = script.name == "identifiability" and which(script.name) is None
    before = f". {path_for_shell(activate)} && " if alone and activate.is_file() else ""
    for what, command in result.next()[:1]:
        line = f"{before}{shorten_line(command)}"
        print_command(f"Next {what[0].lower()}{what[1:]}", line)


def print_help(
    usage: Sequence[str],
    text: str,
    groups: Mapping[str, Sequence[tuple[str, str]]],
    lists: Sequence[str],
) -> None:
    """Print the help of a verb without blank lines that a small screen lacks.

    Parameters
    ----------
    usage : sequence of str
        Parts of the line of usage, after the verb.
    text : str
        Summary, examples between lines of three backticks, and paragraphs of Markdown.
    groups : mapping
        Options and their texts, by the title of their group.
    lists : sequence of str
        Further paragraphs at the end.
    """
    from rich.markdown import Markdown  # noqa: PLC0415
    from rich.table import Table as Grid  # noqa: PLC0415

    console = terminal()
    summary, examples, explained = text.strip().split("```")
    verb = examples.split()[1]
    console.print(f"[bold]{summary.strip()}[/]\n", highlight=False)
    for line in examples.strip().splitlines():
        console.print(f"  {escaped(line)}", highlight=False, soft_wrap=True)
    console.print()
    console.print(Markdown(explained.strip()))
    arguments = " ".join(usage).translate(str.maketrans("", "", "{}")).upper()
    console.print(f"\n[bold]Usage[/]: identifiability {verb} {escaped(arguments)}")
    for title, rows in groups.items():
        grid = Grid.grid(padding=(0, 2, 0, 0), expand=True)
        grid.add_column(max_width=37, overflow="fold")
        grid.add_column(ratio=1)
        for name, said in rows:
            grid.add_row(f"  {escaped(name)}", escaped(said.replace("`", "")))
        console.print(f"[bold]{escaped(title)}[/]", highlight=False)
        console.print(grid)
    for paragraph in lists:
        console.print(escaped(paragraph), highlight=False)


def print_command(what: str, command: str) -> None:
    """Print a line for the user to type: not wrapped, and without markup."""
    sys.stdout.write(f"{what} {for_terminal(command)}\n")


def print_end(texts: Iterable[str], written: Iterable[Path] = ()) -> None:
    """Print the last lines of a command: sentences, and the paths of the written files."""
    console = terminal()
    for text in texts:
        console.print(escaped(text), highlight=False, soft_wrap=not console.is_terminal)
    for path in written:
        sys.stdout.write(f"{path}\n")


# Results are written where they should be, or else elsewhere.


def write_all(*asked: tuple[Write, Path | None]) -> list[Path]:
    """Call functions that write with their paths and return the paths; skip those without a path.

    Raises
    ------
    OutputError
        If a file cannot be written at its path; the others are written first.
    """
    written = []
    failed = []
    for write, path in asked:
        if path is not None:
            try:
                written.append(_write(write, path))
            except OutputError as error:
                failed.append(str(error))
    if failed:
        raise OutputError(" ".join(failed))
    return written


def _write(write: Write, path: Path) -> Path:
    """Write a result; on failure, as with a full disk, write it to a reported folder."""
    try:
        return write(path)
    except OutputError as error:
        from identifiability.foundation.output import FOLDER  # noqa: PLC0415

        elsewhere = Path(mkdtemp(prefix=f"{FOLDER}rescued-")) / path.name
        try:
            write(elsewhere)
        except BaseException as again:  # also Ctrl-C
            rmtree(elsewhere.parent, ignore_errors=True)
            if isinstance(again, OutputError):
                raise error from None
            raise
        raise OutputError(Finding("output.rescued", str(error), place=str(elsewhere))) from None
