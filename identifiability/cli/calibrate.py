"""``identifiability calibrate``."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import (
    check_outputs,
    escaped,
    load_robot,
    progress,
    running,
    sentences,
    write_results,
)


def calibrate(
    robot: options.Robot,
    logs: options.Logs,
    ladder: options.Ladder = None,
    model: Annotated[
        str | None, typer.Option(help="Model of the ladder; default: the unpruned one.")
    ] = None,
    trials: Annotated[
        int,
        typer.Option(min=4, help="Simulated repetitions a row; four times as many in the first."),
    ] = 60,
    sbc: Annotated[
        bool, typer.Option(help="Also check the posterior by simulation (some seconds).")
    ] = True,
    names: Annotated[
        int,
        typer.Option(min=0, help="Repetitions with nothing missing that are diagnosed; 0: none."),
    ] = 40,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    report: options.Report = None,
    json: options.Json = None,
    seed: options.Seed = 0,
    quick: Annotated[
        bool, typer.Option(help="A few repetitions, a wide Monte-Carlo error.")
    ] = False,
    engine: options.Engine = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    resume: options.Resume = None,
) -> None:
    """Measure how far intervals and verdicts can be trusted on this robot and motion.

    The experiment is repeated with planted parameters and noise like the residual: how often do
    95 % intervals hold the truth, of all parameters and of the worst one; how often is a parameter
    called identifiable wrong by more than half? Shares come with their Monte-Carlo error. And are
    planted values ranked uniformly among the draws of their posterior? How often does diagnose name
    an effect when nothing is missing, and how small an effect would it see?

    ```
    identifiability calibrate 3-rps run.csv --report calibration.html
    ```
    """
    with (
        sentences(),
        progress() as say,
        running(engine, workers, scheduler, resume) as runner,
    ):
        from identifiability.workflows.analyze import analyze  # noqa: PLC0415
        from identifiability.workflows.calibrate.calibration import calibrate as run  # noqa: PLC0415

        check_outputs(report, json)
        analysis = analyze(load_robot(robot, sidecar), logs, (), ladder, replicates=0, seed=seed)
        result = run(
            analysis, model=model, trials=8 if quick else trials,
            sbc=(200 if quick else 1000) * sbc, logs=logs,
            diagnoses=min(names, 4) if quick else names, seed=seed, progress=say, engine=runner,
        )  # fmt: skip
        written = write_results(result, report, json, say)
    from rich.console import Console  # noqa: PLC0415

    Console().print(escaped(result.statement), highlight=False, soft_wrap=True)
    for path in written:
        sys.stdout.write(f"{path}\n")
