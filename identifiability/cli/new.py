"""``identifiability new``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from typer import Argument

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command()
def new(
    folder: Annotated[Path, Writes()],
    logs: Annotated[Sequence[str], Argument()] = (),
    robot: str = "six-dof-arm",
) -> None:
    """Make a folder to begin a study in: robot, sidecar, logs, script and Makefile."""
    with common.sentences():
        from identifiability.workflows.study import new_study  # noqa: PLC0415

        made = new_study(folder, robot, logs)
    common.print_end([*made.notes, made.statement], made.written)
