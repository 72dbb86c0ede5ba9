"""``identifiability new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command("workflows/study/__init__.py:new_study")
def new(
    folder: Annotated[Path, Argument(), Writes()],
    logs: Annotated[list[str] | None, Argument()] = None,
    robot: str = "six-dof-arm",
) -> None:
    """Make a folder to begin a study in: robot, sidecar, logs, script and Makefile.

    Without --robot it holds a six-axis arm and three simulated logs in which something is that
    the robot file does not state, so that every command runs at once:

    ```
    identifiability new study
    cd study
    identifiability analyze robot.urdf run1.csv run2.csv --validate run3.csv --report report.html
    ```

    `make` in it writes what the logs determine and what the model misses; study.py does the same
    from Python. 3-rps has logs as well, of a closed chain. With a robot of your own, name your
    logs, or get a template of the columns that they must have:

    ```
    identifiability new mine monday.csv tuesday.csv --robot arm.urdf
    identifiability new mine --robot arm.urdf
    ```

    A table of Denavit and Hartenberg becomes a URDF and its sidecar:

    ```
    identifiability new mine --robot table.toml
    ```
    """
    with common.sentences():
        from identifiability.workflows.study import new_study  # noqa: PLC0415

        made = new_study(folder, robot, logs or ())
    common.print_end([*made.notes, made.statement], made.written)
