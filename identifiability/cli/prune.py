"""``identifiability prune``."""

from __future__ import annotations

import sys
from enum import StrEnum
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
    from identifiability.workflows.prune import Ladder


class Rule(StrEnum):
    """How much held-out error a smaller model may cost."""

    identifiable = "identifiable"
    difference = "one-se-of-difference"
    one_se = "one-se"
    best = "best"


def prune(
    robot: options.Robot,
    logs: options.Logs,
    validate: Annotated[
        list[str] | None,
        typer.Option(help="Log that is only reported on; may be given several times."),
    ] = None,
    ladder: Annotated[
        str | None, typer.Option(help="TOML ladder; pruning starts from its first model.")
    ] = None,
    forbid: Annotated[
        list[str] | None, typer.Option(help="Parameter that must stay; may be given several times.")
    ] = None,
    force: Annotated[
        list[str] | None, typer.Option(help="Parameter that must go; may be given several times.")
    ] = None,
    criterion: Annotated[
        Rule, typer.Option(help="How much held-out error a smaller model may cost.")
    ] = Rule.identifiable,
    propose: Annotated[
        bool, typer.Option(help="Try the symmetries that the robot's joints suggest.")
    ] = True,
    reach: Annotated[
        float, typer.Option(min=0.1, help="How many times faster than in the logs it will move.")
    ] = 1.0,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    report: options.Report = None,
    json: options.Json = None,
    model: Annotated[
        Path | None,
        typer.Option(help="Write the chosen model here, as a ladder of one rung."),
    ] = None,
    derivatives: options.Source = options.Derivatives.auto,
    cutoff: options.Cutoff = None,
    period: options.Period = None,
    harmonics: options.Harmonics = 5,
    decimate: options.Decimate = None,
    method: options.Weighting = "wls",
    cad_prior: options.CadPrior = 0.0,
    seed: options.Seed = 0,
    quick: Annotated[bool, typer.Option(help="A tenth of the random draws.")] = False,
    engine: options.Engine = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    resume: options.Resume = None,
) -> None:
    """Reduce the full model of a robot to the one worth using, from logs alone.

    ```
    identifiability prune 3-rps run.csv --report pruning.html --model pruned.toml
    identifiability analyze 3-rps run.csv --ladder pruned.toml
    ```
    """
    with (
        sentences(),
        progress() as say,
        running(engine, workers, scheduler, resume) as runner,
    ):
        from identifiability.logs.prepare import Preparation  # noqa: PLC0415
        from identifiability.workflows.prune import prune as run  # noqa: PLC0415

        read = [robot, *logs, *(validate or ()), ladder, sidecar]
        check_outputs(report, json, model, inputs=read)
        how = Preparation(derivatives.value, cutoff, period, harmonics, decimate)
        result = run(
            load_robot(robot, sidecar), logs, validate or (), ladder, forbid=forbid or (),
            force=force or (), criterion=criterion.value, propose=propose, reach=reach,
            preparation=how, method=method, replicates=20 if quick else 200,
            cad_weight=cad_prior, seed=seed, progress=say, engine=runner,
        )  # fmt: skip
        written = write_results(result, report, json, say)
        if model is not None:
            written.append(result.write_model(model))
    print_pruning(result, written)


def print_pruning(result: Ladder, written: list[Path]) -> None:
    """Print the ladder about the rung to use, the statement, and the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console()
    title = f"{escaped(result.robot.title)}: the way down (▸ use this rung)"
    table = Table(title=title, title_justify="left")
    for heading in ("size", "identifiable", "error", "unseen", "± SE", "signs", "move"):
        table.add_column(heading, justify="left" if heading in ("signs", "move") else "right")
    for k, rung in enumerate(result.rungs[: result.selected + 4]):
        move = rung.step.move
        table.add_row(
            f"{'▸ ' if k == result.selected else ''}{len(rung)}",
            "not judged" if rung.unjudged else str(rung.identifiable),
            percent(rung.error_ra), percent(rung.error_ra_unseen),
            percent(rung.error_se), "possible" if rung.feasible else "impossible",
            escaped(f"{move.kind.value}: {_short(move.text)}") if move is not None else "",
        )  # fmt: skip
    console.print(table)
    print_errors(console, result.chosen.name, result.error_frame())
    wide = not console.is_terminal
    console.print(escaped(result.statement), highlight=False, soft_wrap=wide)
    if not result.nothing:
        console.print(escaped(result.stability.statement), highlight=False, soft_wrap=wide)
    for path in written:
        sys.stdout.write(f"{path}\n")


def _short(text: str, most: int = 60) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
