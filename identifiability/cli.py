"""The command line: load, validate, call the function of the same name, print where results are."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from identifiability.errors import IdentifiabilityError

if TYPE_CHECKING:
    from identifiability.analysis import Analysis, Progress
    from identifiability.robot import Robot
    from identifiability.simulation import PrescribedMotion

app = typer.Typer(
    name="identifiability",
    help="Which dynamic parameters of a robot do your logs determine, and which model is worth "
    "using?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


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


RobotArgument = Annotated[
    str, typer.Argument(help="MJCF or URDF file, or a shipped robot such as 3-rps.")
]
LogsArgument = Annotated[
    list[str],
    typer.Argument(
        help="Logs to fit: CSV or Parquet with t, <joint>.q, <joint>.tau and, if measured, "
        "<joint>.dq, <joint>.ddq; SI units."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of every random choice.")]


@contextmanager
def sentences() -> Iterator[None]:
    """Turn the library's errors into one line on standard error and exit code 2."""
    try:
        yield
    except IdentifiabilityError as error:
        from rich.console import Console  # noqa: PLC0415

        Console(stderr=True).print(
            f"[red]Error:[/] {_escape(str(error))}", highlight=False, soft_wrap=True
        )
        raise typer.Exit(2) from None
    except KeyboardInterrupt:
        sys.stderr.write("Stopped; nothing was written.\n")
        raise typer.Exit(130) from None


def _escape(text: str) -> str:
    from rich.markup import escape  # noqa: PLC0415

    return escape(text)


@contextmanager
def progress(*, show: bool = True) -> Iterator[Progress]:
    """Show a progress bar on a terminal; give a callback (what, share)."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not show) as bar:
        task = bar.add_task("starting", total=1.0)

        def say(text: str, share: float) -> None:
            bar.update(task, description=text, completed=share)

        yield say


@app.command()
def analyze(
    robot: RobotArgument,
    logs: LogsArgument,
    validate: Annotated[
        list[str] | None, typer.Option(help="Held-out log; may be given several times.")
    ] = None,
    ladder: Annotated[
        str | None, typer.Option(help="TOML ladder of models; default: the one beside the robot.")
    ] = None,
    sidecar: Annotated[
        str | None, typer.Option(help="TOML with what the robot file cannot say.")
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Write an HTML report here.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the result as JSON here.")] = None,
    derivatives: Annotated[
        Derivatives, typer.Option(help="Velocity and acceleration: the log's own or computed.")
    ] = Derivatives.auto,
    cutoff: Annotated[
        float | None, typer.Option(min=0, help="Low-pass for computed derivatives [Hz].")
    ] = None,
    period: Annotated[
        float | None, typer.Option(min=0, help="Period of periodic motion [s], for fourier.")
    ] = None,
    harmonics: Annotated[int, typer.Option(min=1, help="Harmonics of the Fourier fit.")] = 5,
    decimate: Annotated[
        int | None, typer.Option(min=1, help="Parallel filter and keep every k-th sample.")
    ] = None,
    method: Annotated[
        Method, typer.Option(help="Weight actuators by their own variance, or all alike.")
    ] = Method.wls,
    seed: Seed = 0,
    quick: Annotated[bool, typer.Option(help="Fewer random draws.")] = False,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use.

    ```
    identifiability analyze 3-rps run1.csv --validate run2.csv --report report.html
    identifiability analyze arm.urdf run.parquet --ladder models.toml --json result.json
    ```
    """
    del quick  # nothing here is random enough yet to be shortened
    with sentences(), progress() as say:
        from identifiability.analysis import analyze as run  # noqa: PLC0415
        from identifiability.output import check_writable  # noqa: PLC0415
        from identifiability.samples import Preparation  # noqa: PLC0415

        for path in (report, json):
            if path is not None:
                check_writable(path)
        how = Preparation(derivatives.value, cutoff, period, harmonics, decimate)
        result = run(
            _load(robot, sidecar), logs, validate or (), ladder, preparation=how,
            method=method.value, seed=seed, progress=say,
        )  # fmt: skip
        written = _write(result, report, json, say)
    _print_analysis(result, written)


@app.command()
def simulate(
    robot: RobotArgument,
    motion: Annotated[
        str,
        typer.Argument(
            help="CSV or Parquet with t and <joint>.q (and <joint>.dq, <joint>.ddq), the name of a "
            "shipped trajectory (3-rps: 571, 595, 601), FILE.json:NAME, or 'random'."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Log to write: .csv or .parquet.")],
    noise: Annotated[
        str, typer.Option(help="'none', 'paper', or levels such as motion=0.04,torque=0.05.")
    ] = "none",
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect in the data but not in the robot file, as EFFECT or EFFECT=SHARE."
        ),
    ] = None,
    samples: Annotated[int | None, typer.Option(min=20, help="Samples a period.")] = None,
    derivatives: Annotated[
        bool, typer.Option(help="Whether the log has velocities and accelerations.")
    ] = True,
    sidecar: Annotated[
        str | None, typer.Option(help="TOML with what the robot file cannot say.")
    ] = None,
    seed: Seed = 0,
) -> None:
    """Make the log of a simulated robot along a prescribed motion.

    ```
    identifiability simulate 3-rps 601 --noise paper --out run.csv
    identifiability simulate 3-rps random --hide stribeck_friction=0.1 --out run.parquet
    ```
    """
    with sentences():
        import numpy as np  # noqa: PLC0415

        from identifiability.output import check_writable  # noqa: PLC0415
        from identifiability.simulation import Noise  # noqa: PLC0415
        from identifiability.simulation import simulate as run  # noqa: PLC0415

        check_writable(out)
        machine = _load(robot, sidecar)
        rng = np.random.default_rng(seed)
        move = _motion(machine, motion, samples, rng)
        log = run(
            machine, move, noise=Noise.parse(noise), hide=hide or (), rng=rng,
            derivatives=derivatives,
        )  # fmt: skip
        log.write(out)
    typer.echo(f"{len(log)} samples of {machine.name} along {log.name}: {out}")


@app.command()
def demo(
    quick: Annotated[bool, typer.Option(help="100 samples instead of 750.")] = False,
    folder: Annotated[Path, typer.Option(help="Where to write demo.html and demo.json.")] = Path(
        "reports"
    ),
    seed: Seed = 0,
) -> None:
    """Run the main job on a simulated robot: the paper's 3-RPS with the paper's noise.

    Models 1 to 4 are fitted to one trajectory and validated on another; the report is
    reports/demo.html.
    """
    with sentences(), progress() as say:
        from identifiability.demo import run_demo  # noqa: PLC0415
        from identifiability.output import check_writable  # noqa: PLC0415

        folder.mkdir(parents=True, exist_ok=True)
        report, json = folder / "demo.html", folder / "demo.json"
        check_writable(report)
        result = run_demo(quick=quick, seed=seed, progress=say)
        written = _write(result, report, json, say)
    _print_analysis(result, written)


def _load(robot: str, sidecar: str | None) -> Robot:
    from identifiability.robot import Robot  # noqa: PLC0415

    return Robot.load(robot, sidecar)


def _motion(robot: Robot, source: str, samples: int | None, rng: Any) -> PrescribedMotion:
    from identifiability.simulation import motion  # noqa: PLC0415

    return motion.find_motion(robot, source, samples, rng)


def _write(
    result: Analysis, report: Path | None, json: Path | None, say: Callable[[str, float], None]
) -> list[Path]:
    written = []
    if json is not None:
        written.append(result.to_json(json))
    if report is not None:
        say("drawing the report", 0.95)
        written.append(result.write_report(report))
    return written


def _print_analysis(result: Analysis, written: list[Path]) -> None:
    """Print the statement, the ladder, and last the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console()
    table = Table(
        title=f"{_escape(result.robot.title)}: models (▸ use this one)", title_justify="left"
    )
    for heading in ("model", "size", "10× rule", "identifiable", "error", "held out", "signs"):
        table.add_column(heading, justify="left" if heading in ("model", "signs") else "right")
    for k, m in enumerate(result.models):
        mark = "▸ " if k == result.selected else "  "
        table.add_row(
            mark + _escape(m.name), str(len(m.rung)), str(m.paper_identified),
            str(sum(v.verdict.value == "identifiable" for v in m.verdicts)),
            f"{100 * m.error_ra:.2f} %", f"{100 * m.error_ra_validation:.2f} %",
            "possible" if m.feasible else "impossible",
        )  # fmt: skip
    console.print(table)
    console.print(_escape(result.statement), highlight=False, soft_wrap=not console.is_terminal)
    for path in written:
        sys.stdout.write(f"{path}\n")


def main() -> None:
    """Run the command line."""
    app()
