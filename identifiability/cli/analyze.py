"""``identifiability analyze``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import (
    check_outputs,
    escaped,
    load_robot,
    percent,
    print_errors,
    progress,
    running,
    sentences,
    write_results,
)

if TYPE_CHECKING:
    from identifiability.workflows.analyze import Analysis


def analyze(
    robot: options.Robot,
    logs: options.Logs,
    validate: options.Validate = None,
    ladder: options.Ladder = None,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    report: options.Report = None,
    json: options.Json = None,
    derivatives: options.Source = options.Derivatives.auto,
    cutoff: options.Cutoff = None,
    period: options.Period = None,
    harmonics: options.Harmonics = 5,
    decimate: options.Decimate = None,
    method: options.Weighting = "wls",
    posterior: Annotated[
        bool, typer.Option(help="Sample the posteriors of the selected model (some seconds).")
    ] = True,
    cad_prior: options.CadPrior = 0.0,
    seed: options.Seed = 0,
    quick: Annotated[bool, typer.Option(help="A tenth of the random draws, no posterior.")] = False,
    engine: options.Engine = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    resume: options.Resume = None,
) -> None:
    """Say which parameters the logs determine, and which model of a ladder to use.

    **You give** a robot file and one or more logs of its motion and torque. The motion should be
    as fast and as varied as the robot will ever move: what it never excites, no fit can tell.

    **You get** one verdict a parameter. *identifiable*: use the value. *weak*: only its sign is
    certain. *negligible*: leave it out. *not identifiable*: do not believe the number, whatever it
    is; the reason says whether noise, the motion or the structure is to blame. *not judged*: the
    logs are too short, or too slow for their cut-off, to say anything. And you get the
    model to use (▸): the smallest that predicts unseen motion as well as the best does.

    **Hold a log back** with --validate. Without one, stretches of the logs take turns.

    Begin with

        identifiability analyze 3-rps run.csv --report report.html

    and read the report from the top. Then

        identifiability analyze 3-rps run.csv --validate other.csv
        identifiability analyze arm.urdf a.csv b.csv --json arm.json
        identifiability analyze arm.urdf run.csv --cutoff 10
        identifiability analyze arm.urdf run.mcap:/joint_states

    Too few identifiable? Move faster and in other directions, log longer, or let *prune* look for
    the smaller model that these logs support. Error much above the noise? Something is missing in
    the model: *diagnose* names it.
    """
    with (
        sentences(),
        progress() as say,
        running(engine, workers, scheduler, resume) as runner,
    ):
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415
        from identifiability.workflows.analyze import analyze as run  # noqa: PLC0415

        read = [robot, *logs, *(validate or ()), ladder, sidecar]
        check_outputs(report, json, inputs=read)
        how = Preparation(derivatives.value, cutoff, period, harmonics, decimate)
        result = run(
            load_robot(robot, sidecar), logs, validate or (), ladder, preparation=how,
            method=method,
            replicates=200 if quick else 2000, posterior=posterior and not quick,
            cad_weight=cad_prior,
            seed=seed, progress=say,
            # Left to itself it ends the processes as soon as the logs have been read.
            engine=runner if any((engine, workers, scheduler, resume)) else None,
        )  # fmt: skip
        written = write_results(result, report, json, say)
    print_analysis(result, written)


def print_analysis(result: Analysis, written: list[Path]) -> None:
    """Print the ladder, the errors, the statement, and last the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    from identifiability.estimation.verdict import Class  # noqa: PLC0415

    console = Console()
    table = Table(
        title=f"{escaped(result.robot.title)}: models (▸ use this one)", title_justify="left"
    )
    for heading in ("model", "size", "10× rule", "identifiable", "error", "held out", "real robot"):
        table.add_column(heading, justify="left" if heading in ("model", "real robot") else "right")
    for k, m in enumerate(result.models):
        mark = "▸ " if k == result.selected else "  "
        table.add_row(
            mark + escaped(m.name), str(len(m.rung)), str(m.paper_identified),
            "not judged" if m.unjudged else str(m.count(Class.IDENTIFIABLE)),
            percent(m.error_ra), percent(m.error_ra_validation), m.possible,
        )  # fmt: skip
    console.print(table)
    print_errors(console, result.chosen.name, result.error_frame())
    console.print(escaped(result.statement), highlight=False, soft_wrap=not console.is_terminal)
    for path in written:
        sys.stdout.write(f"{path}\n")
