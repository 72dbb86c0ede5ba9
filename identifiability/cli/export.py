"""``identifiability export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

ENDINGS = (".xml", ".urdf", ".json", ".py", ".csv", ".parquet", ".pq")


@options.command(
    "workflows/export/workflow.py",
    "workflows/export/draws.py:draw_robots prior seed",
    form="--format",
    force="--force",
)
def export(
    machine: options.Machine,
    result: options.JsonResult,
    out: Annotated[Path, Option(), Writes(*ENDINGS)],
    draws: Annotated[int | None, Option(min=1)] = None,
    **own: Any,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file.

    Masses, friction, rotors and springs become those of the real robot nearest to the data;
    what the model leaves out is zero, and what the data do not determine stays as near as it can
    to the file's. What the file cannot hold stands in a sidecar beside it. Two errors on the
    fitted logs are stated: of all that was fitted, and of what the file alone holds; where the
    second is more than three times the first, nothing is written without --force.

    **You give** the robot and the JSON that analyze, prune or diagnose wrote. **You get** a file
    for what comes next, by its ending:

        identifiability analyze arm.urdf run.csv --json result.json
        identifiability export arm.urdf result.json --out fitted.urdf
        identifiability export arm.urdf result.json --out simulator.xml  # rotors and friction too
        identifiability export arm.urdf result.json --out values.json
        identifiability export robot.xml result.json --format isaaclab --out servos.py
        identifiability export robot.xml result.json --draws 200 --out draws.csv

    With --draws robots are drawn that the logs leave possible, for randomising a simulator by what
    is not known and by as much: a table with a row each, or a robot file each (fitted-001.xml …).

    Parameters
    ----------
    out
        File to write: .xml (MJCF) or .urdf, .json with the parameters alone, .py for
        Isaac Lab; draws also as a table, .csv or .parquet.
    draws
        How many robots to draw instead.
    """
    with common.sentences():
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.regression.reduction import unused_ladder  # noqa: PLC0415
        from identifiability.workflows.export import export as run  # noqa: PLC0415

        robot, prior, seed = machine.load(), own.pop("prior"), own.pop("seed")
        if draws is not None:
            from identifiability.workflows.export import draw_robots  # noqa: PLC0415

            found = draw_robots(robot, result, draws, prior=prior, seed=seed)
            written = found.write(out)
            typer.echo(found.statement)
            typer.echo(f"{written[0]}" + (f" … {written[-1].name}" if len(written) > 1 else ""))
            return
        if prior is not None:
            raise OptionError("--prior is of bodies that are drawn; say how many: --draws 100.")
        exported = run(robot, result, out, **own)
    for line in (exported.mass, exported.statement):
        if line:
            typer.echo(line)
    for text in unused_ladder(robot):
        typer.echo(text, err=True)
    for path in (exported.robot, exported.sidecar):
        if path is not None:
            typer.echo(f"{path}")
