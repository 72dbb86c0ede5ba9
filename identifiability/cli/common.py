"""What the commands share: sentences instead of tracebacks, progress, engines, writing."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

from identifiability.foundation.errors import IdentifiabilityError

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.console import Console

    from identifiability.foundation.engines.local import OpenEngine
    from identifiability.robot import Robot


class Result(Protocol):
    """What every command's result can do."""

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON."""

    def write_report(self, path: str | Path) -> Path:
        """Write the result as HTML."""


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
        _fail(f"'{error.filename}' cannot be used: {error.strerror or error}.")
    except MemoryError:
        _fail("There is not enough memory for this; give fewer samples or decimate them.")
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
    """Return text in which rich finds no markup."""
    from rich.markup import escape  # noqa: PLC0415

    return escape(text)


def percent(share: float) -> str:
    """Return a relative error in percent, or a dash where there is none."""
    return f"{100 * share:.2f} %" if math.isfinite(share) else "–"


@contextmanager
def progress(*, show: bool = True) -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar on a terminal; give a callback (what, share)."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    off = not (show and console.is_terminal)
    with Progress(*columns, console=console, transient=True, disable=off) as bar:
        task = bar.add_task("starting", total=1.0)

        def say(text: str, share: float) -> None:
            bar.update(task, description=text, completed=share)

        yield say


@contextmanager
def running(
    name: Any, workers: int | None, scheduler: str | None, resume: Path | None
) -> Iterator[OpenEngine]:
    """Give the engine that the options ask for; end its processes with the command."""
    from identifiability.foundation.engines.local import choose_engine  # noqa: PLC0415

    with choose_engine(name, workers, scheduler, resume) as engine:
        yield engine


def load_robot(robot: str, sidecar: str | None) -> Robot:
    """Return the robot of a file or a shipped name."""
    from identifiability.robot import Robot  # noqa: PLC0415

    return Robot.load(robot, sidecar)


def write_results(
    result: Result, report: Path | None, json: Path | None, say: Callable[[str, float], None]
) -> list[Path]:
    """Write what was asked for and return the paths, the report last."""
    written = []
    if json is not None:
        written.append(result.to_json(json))
    if report is not None:
        say("drawing the report", 0.95)
        written.append(result.write_report(report))
    return written


def check_outputs(*paths: Path | None, inputs: Iterable[str | Path | None] = ()) -> None:
    """Refuse paths that cannot be written, or are inputs, before a long computation starts."""
    from identifiability.foundation.output import check_apart, check_writable  # noqa: PLC0415

    outputs = [check_writable(path) for path in paths if path is not None]
    check_apart(outputs, [path for path in inputs if path is not None])


#: Joints, and logs, whose errors are listed.
LISTED = 12


def print_errors(console: Console, model: str, errors: DataFrame) -> None:
    """Print the errors of a model by joint and by log, the largest where they are many."""
    from rich.table import Table  # noqa: PLC0415

    errors = errors[errors.groupby("of")["of"].transform("size") > 1]
    if not len(errors):
        return
    table = Table()  # its title would be wrapped to its width
    console.print(
        f"[italic]Errors of {escaped(model)} by joint and by log[/italic]", soft_wrap=True
    )
    for heading in ("joint or log", "error", "held out"):
        table.add_column(heading, justify="left" if heading == "joint or log" else "right")
    for _, part in errors.groupby("of"):
        order = part.sort_values("error_validation", ascending=False)[:LISTED].index
        for row in part.loc[sorted(order)].itertuples():
            numbers = (f"{100 * e:.1f} %" if math.isfinite(e) else "—" for e in (row[3], row[4]))
            table.add_row(escaped(str(row[2])), *numbers)
        if len(part) > LISTED:
            table.add_row(f"… {len(part) - LISTED} with smaller errors", "", "")
        table.add_section()
    console.print(table)
