"""``identifiability diagnose``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import (
    check_outputs,
    escaped,
    load_robot,
    progress,
    sentences,
    write_results,
)

if TYPE_CHECKING:
    from identifiability.workflows.diagnose import Diagnosis


def diagnose(
    robot: options.Robot,
    logs: options.Logs,
    validate: options.Validate = None,
    effects: Annotated[
        str | None,
        typer.Option(help="Families that may be named, such as stribeck_friction,time_delay."),
    ] = None,
    model: options.Model = None,
    fixed: Annotated[
        bool, typer.Option("--fixed", help="Keep the robot file's values instead of refitting.")
    ] = False,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    report: options.Report = None,
    json: options.Json = None,
    seed: options.Seed = 0,
    quick: Annotated[bool, typer.Option(help="Half the draws: coarser p-values.")] = False,
) -> None:
    """Find where model and logs disagree, name the missing effect, add it, show the gap shrink.

    ```
    identifiability diagnose 3-rps run1.csv run2.csv --validate run3.csv --report gap.html
    identifiability diagnose arm.urdf run.parquet --model rigid_body --json gap.json
    ```
    """
    with sentences(), progress() as say:
        from identifiability.workflows.diagnose import diagnose as run  # noqa: PLC0415

        check_outputs(report, json, inputs=(robot, sidecar, *logs, *(validate or ())))
        result = run(
            load_robot(robot, sidecar), logs, validate or (), effects=split_names(effects),
            model=split_model(model), fixed=fixed, seed=seed, quick=quick, progress=say,
        )  # fmt: skip
        written = write_results(result, report, json, say)
    print_diagnosis(result, written)


def split_names(text: str | None) -> list[str] | None:
    """Return the names in ``a,b c``, or None."""
    return None if text is None else text.replace(",", " ").split()


def split_model(text: str | None) -> list[str] | str | None:
    """Return the effects in ``a,b``, or the path of a model file as it is."""
    return text if text is None or text.lower().endswith(".toml") else split_names(text)


def print_diagnosis(result: Diagnosis, written: list[Path]) -> None:
    """Print the named effects, the statement, and last the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console()
    if result.effects:
        table = Table(
            title=f"{escaped(result.robot.title)}: effects that were missing", title_justify="left"
        )
        for heading in ("effect", "where", "p", "unseen error before", "after"):
            left = heading in ("effect", "where")
            table.add_column(heading, justify="left" if left else "right")
        for e in result.effects:
            table.add_row(
                escaped(" or ".join([e.name, *e.alternatives])), escaped(", ".join(e.joints)),
                f"{e.p_value:.2g}", f"{100 * e.before:.2f} %", f"{100 * e.after:.2f} %",
            )  # fmt: skip
        console.print(table)
    console.print(escaped(result.statement), highlight=False, soft_wrap=not console.is_terminal)
    for path in written:
        sys.stdout.write(f"{path}\n")
