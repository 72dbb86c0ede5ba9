"""``identifiability convert``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Option

from identifiability.cli import common, options


@options.command
def convert(table: Path, out: Annotated[Path, Option()]) -> None:
    """Write the robot file of a table of Denavit and Hartenberg, and its sidecar.

    Standard and modified tables, prismatic joints, several children of one link, links that are
    fixed or follow others, closures such as parallelograms, springs between links, masses and
    inertias where they are known. The robot is the file that is written, not the table.

    ```
    identifiability convert dh.toml --out robot.xml
    identifiability inspect robot.xml
    ```

    Parameters
    ----------
    table
        TOML with the rows of the table (identifiability/robot/dh/table.py lists every key).
    out
        MJCF to write (.xml); the sidecar of the same name (.toml) stands beside it.
    """
    with common.sentences():
        from identifiability.robot.dh import convert_dh  # noqa: PLC0415

        common.check_outputs(out, inputs=[table])
        converted = convert_dh(table, out)
    for note in converted.notes:
        typer.echo(note, err=True)
    for path in (converted.robot, converted.sidecar):
        typer.echo(f"{path}")
