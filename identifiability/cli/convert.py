"""``identifiability convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Reads, Writes


@options.command("robot/dh.py:convert_dh")
def convert(
    table: Annotated[Path, Argument(), Reads("DH table", "TOML")],
    out: Annotated[Path, Option(), Writes(".xml")],
) -> None:
    """Write the robot file of a table of Denavit and Hartenberg, and its sidecar.

    **You give** a TOML file with the rows of the table: standard or modified, joints that turn or
    slide, several children of one link, links that are fixed or follow others, closures such as
    parallelograms, springs between links; masses and inertias where they are known.

        convention = "modified"

        [[links]]
        name = "upper_arm"
        joint = "shoulder"
        d = 0.15
        alpha = "-pi/2"
        mass = 17.4

    **You get** an MJCF for every other verb and for MuJoCo, its sidecar beside it, and a sentence
    on what the table leaves open. The robot is the file that is written, not the table.

        identifiability convert dh.toml --out robot.xml
        identifiability inspect robot.xml
    """
    with common.sentences():
        from identifiability.robot.dh import convert_dh  # noqa: PLC0415

        converted = convert_dh(table, out)
    for note in converted.notes:
        typer.echo(note, err=True)
    for path in (converted.robot, converted.sidecar):
        typer.echo(f"{path}")
