"""``identifiability export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import Count, ExportFormat, NotNegative, Seed

ENDINGS = (".xml", ".urdf", ".json", ".py", ".csv", ".parquet", ".pq")


@options.command()
def export(
    machine: options.Machine,
    result: options.JsonResult,
    out: Annotated[Path, Option(), Writes(*ENDINGS)],
    draws: Count | None = None,
    form: Annotated[ExportFormat | None, Option("--format")] = None,
    force: Annotated[bool, Option("--force")] = False,
    prior: NotNegative | None = None,
    seed: Seed = 0,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file."""
    with common.sentences():
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.regression.reduction import unused_ladder  # noqa: PLC0415
        from identifiability.workflows.export import export as run  # noqa: PLC0415

        robot = machine.load()
        if draws is not None:
            from identifiability.workflows.export import draw_robots  # noqa: PLC0415

            found = draw_robots(robot, result, draws, prior=prior, seed=seed)
            written = found.write(out)
            typer.echo(found.statement)
            typer.echo(f"{written[0]}" + (f" … {written[-1].name}" if len(written) > 1 else ""))
            return
        if prior is not None:
            raise OptionError("--prior is of bodies that are drawn; say how many: --draws 100.")
        exported = run(robot, result, out, form, force=force)
    for line in (exported.mass, exported.statement):
        if line:
            typer.echo(line)
    for text in unused_ladder(robot):
        typer.echo(text, err=True)
    for path in (exported.robot, exported.sidecar):
        if path is not None:
            typer.echo(f"{path}")
