"""``identifiability export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command
def export(
    machine: options.Machine,
    result: options.JsonResult,
    out: Annotated[Path, Option(), Writes(".xml", ".urdf", ".json", ".py", ".c")],
    form: Annotated[
        Literal["mjcf", "urdf", "json", "python", "c"] | None, Option("--format")
    ] = None,
    *,
    force: Annotated[bool, Option("--force")] = False,
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
        identifiability export arm.urdf result.json --out torque.c  # for a controller

    Parameters
    ----------
    result
        JSON that analyze, prune or diagnose wrote.
    out
        File to write: .xml (MJCF) or .urdf, .json with the parameters alone, .py or .c with a
        function that computes the torques (extra codegen; closed chains in Python, which closes
        their loops).
    form
        What to write; default: what the ending says. From an MJCF comes a URDF as well, and
        the other way round, without geometry.
    force
        Write a robot file that alone errs by more than three times the error of all that was
        fitted.
    """
    with common.sentences():
        from identifiability.regression.reduction import unused_ladder  # noqa: PLC0415
        from identifiability.workflows.export import export as run  # noqa: PLC0415

        robot = machine.load()
        exported = run(robot, result, out, form, force=force)
    for line in (exported.mass, exported.statement):
        if line:
            typer.echo(line)
    for text in unused_ladder(robot):
        typer.echo(text, err=True)
    for path in (exported.robot, exported.sidecar):
        if path is not None:
            typer.echo(f"{path}")
