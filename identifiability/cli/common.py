"""What the commands share: arguments, sentences instead of tracebacks, progress, writing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn, Protocol

import typer

from identifiability.errors import IdentifiabilityError

if TYPE_CHECKING:
    from identifiability.robot import Robot


class Result(Protocol):
    """What every command's result can do."""

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON."""

    def write_report(self, path: str | Path) -> Path:
        """Write the result as HTML."""


class Derivatives(StrEnum):
    """Where velocity and acceleration come from."""

    auto = "auto"
    given = "given"
    butterworth = "butterworth"
    fourier = "fourier"


class Method(StrEnum):
    """Least squares, actuators weighted by their own variance or all alike."""

    wls = "wls"
    ols = "ols"


def _robots(typed: str) -> list[str]:
    """Return the shipped robots that begin so, for the shell; it adds the files itself."""
    package = Path(__file__).resolve().parents[1]
    shipped = [*package.glob("models/*/robot.*"), *package.parent.glob("models/*/robot.*")]
    return sorted({p.parent.name for p in shipped if p.parent.name.startswith(typed)})


RobotArgument = Annotated[
    str,
    typer.Argument(
        help="MJCF or URDF file, or a shipped robot such as 3-rps.", autocompletion=_robots
    ),
]
LogsArgument = Annotated[
    list[str],
    typer.Argument(
        help="Logs to fit: CSV or Parquet with `t`, `<joint>.q`, `<joint>.tau` and, if measured, "
        "`<joint>.dq`, `<joint>.ddq`, in SI units; or bags of ROS, as `run.mcap:/joint_states`."
    ),
]
SidecarOption = Annotated[
    str | None, typer.Option(help="TOML with what the robot file cannot say.")
]
ReportOption = Annotated[Path | None, typer.Option(help="Write an HTML report here.")]
JsonOption = Annotated[Path | None, typer.Option(help="Write the result as JSON here.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of every random choice.")]


@contextmanager
def sentences() -> Iterator[None]:
    """Turn the library's errors into one line on standard error and exit code 2."""
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
        raise typer.Exit(130) from None


def _fail(sentence: str) -> NoReturn:
    from rich.console import Console  # noqa: PLC0415

    Console(stderr=True).print(
        f"[red]Error:[/] {escaped(sentence)}", highlight=False, soft_wrap=True
    )
    raise typer.Exit(2) from None


def escaped(text: str) -> str:
    """Return text in which rich finds no markup."""
    from rich.markup import escape  # noqa: PLC0415

    return escape(text)


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
    from identifiability.output import check_apart, check_writable  # noqa: PLC0415

    outputs = [check_writable(path) for path in paths if path is not None]
    check_apart(outputs, [path for path in inputs if path is not None])
