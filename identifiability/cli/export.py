"""``identifiability export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import check_outputs, load_robot, sentences


def export(
    robot: options.Robot,
    result: Annotated[Path, typer.Argument(help="JSON that analyze wrote.")],
    out: Annotated[Path, typer.Option(help="Robot file to write: .xml (MJCF) or .urdf.")],
    sidecar: options.Sidecar = None,
) -> None:
    """Write the physically feasible parameters of a result back into the robot file.

    Inertials, armature, damping and frictionloss become those of the real robot nearest to the
    data; parameters that the data do not determine stay as near as they can to the file's.

    ```
    identifiability analyze 3-rps run.csv --json result.json
    identifiability export 3-rps result.json --out fitted.xml
    ```
    """
    with sentences():
        from identifiability.export import read_parameters  # noqa: PLC0415
        from identifiability.ladder import unused_ladder  # noqa: PLC0415
        from identifiability.robot.write import write_robot  # noqa: PLC0415

        check_outputs(out, inputs=[robot, result, sidecar])
        machine = load_robot(robot, sidecar)
        written = write_robot(machine, read_parameters(machine, result), out)
    for text in unused_ladder(machine):
        typer.echo(text, err=True)
    typer.echo(f"{written.robot}")
    if written.sidecar is not None:
        typer.echo(f"{written.sidecar}  (what the robot file cannot hold)")
    if written.left_out:
        typer.echo(f"Left out, no file can hold them: {', '.join(written.left_out)}")
