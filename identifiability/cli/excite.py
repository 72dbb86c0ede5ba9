"""``identifiability excite``."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from identifiability.cli import options
from identifiability.cli.common import check_outputs, escaped, load_robot, progress, sentences
from identifiability.cli.diagnose import split_model

if TYPE_CHECKING:
    from identifiability.workflows.excite import Excitation


class Criterion(StrEnum):
    """What the motion is good for."""

    condition = "condition"
    information = "information"
    separate = "separate"


def excite(
    robot: options.Robot,
    out: Annotated[
        Path,
        typer.Option(
            help="File to write: .json (coefficients; 'simulate ROBOT FILE.json' follows it) or "
            ".csv (one period of t, JOINT.q, JOINT.dq, JOINT.ddq)."
        ),
    ],
    harmonics: Annotated[
        int, typer.Option(min=1, max=50, help="Harmonics of the Fourier series.")
    ] = 5,
    duration: Annotated[float, typer.Option(help="Period of the motion [s].")] = 7.5,
    samples: Annotated[int, typer.Option(min=5, help="Samples a period, all checked.")] = 750,
    limits: Annotated[
        Path | None,
        typer.Option(
            help="TOML with JOINT = {q = [low, high], v = speed, a = acceleration} and "
            "[workspace.BODY] x, y, z = [low, high]; replaces the robot's own."
        ),
    ] = None,
    criterion: Annotated[
        Criterion | None,
        typer.Option(
            help="Condition number, information about parameters, or separation of two effects; "
            "default: what the other options suggest."
        ),
    ] = None,
    start_from: Annotated[
        list[str] | None,
        typer.Option(help="Log that was measured already; find what to measure next. Repeatable."),
    ] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(help="Base parameter that the information is about. Repeatable."),
    ] = None,
    separate: Annotated[
        list[str] | None,
        typer.Option(help="Effect to tell from another, as NAME or NAME@JOINT; give it twice."),
    ] = None,
    model: options.Model = None,
    evaluations: Annotated[
        int, typer.Option(min=1, help="Motions that the search looks at, at most.")
    ] = 15_000,
    time_limit: Annotated[
        float | None,
        typer.Option(help="Stop after this time [s]; the motion then depends on the machine."),
    ] = None,
    sidecar: options.Sidecar = None,
    plugin: options.Plugin = None,
    report: options.Report = None,
    seed: options.Seed = 0,
) -> None:
    """Find a motion that is worth measuring, within the limits of the robot.

    The motion is a finite Fourier series that keeps the limits of position, speed and
    acceleration; a closed chain also stays away from singular configurations.

    ```
    identifiability excite 3-rps --out motion.json --report motion.html
    identifiability excite 3-rps --start-from run.csv --parameter platform.mx --out next.json
    identifiability excite 3-rps --separate joint_stiffness --separate torque_offset --out m.json
    identifiability simulate 3-rps motion.json --out run.csv
    ```
    """
    with sentences(), progress() as say:
        from identifiability.foundation.errors import OutputError  # noqa: PLC0415
        from identifiability.workflows.excite import excite as run  # noqa: PLC0415

        inputs = [robot, limits, sidecar, *(start_from or ())]
        check_outputs(out, report, inputs=inputs)
        if out.suffix.lower() not in (".json", ".csv"):
            raise OutputError(f"'{out}' is neither .json nor .csv; give it one of these endings.")
        result = run(
            load_robot(robot, sidecar), harmonics=harmonics, duration=duration, samples=samples,
            limits=limits, criterion=None if criterion is None else criterion.value,
            parameters=parameter, model=split_model(model), start_from=start_from or None,
            separate=separate, evaluations=evaluations, time_limit=time_limit, seed=seed,
            progress=say,
        )  # fmt: skip
        json = out.suffix.lower() == ".json"
        written = [result.to_json(out) if json else result.write_motion(out)]
        if report is not None:
            say("drawing the report", 0.99)
            written.append(result.write_report(report))
    print_excitation(result, written)


def print_excitation(result: Excitation, written: list[Path]) -> None:
    """Print the limits kept, the statement, and the paths of what was written."""
    from rich.console import Console  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415

    console = Console()
    table = Table(title=f"{escaped(result.robot.title)}: the motion", title_justify="left")
    table.add_column("joint")
    for heading in ("from", "to", "speed", "of", "acceleration", "of"):
        table.add_column(heading, justify="right")
    for row in result.to_frame().to_dict("records"):
        keys = (
            "least", "largest", "speed", "speed_limit", "acceleration", "acceleration_limit",
        )  # fmt: skip
        table.add_row(escaped(str(row["joint"])), *(f"{row[k]:.3g}" for k in keys))
    console.print(table)
    wide = not console.is_terminal
    for text in (result.statement, *result.hints):
        console.print(escaped(text), highlight=False, soft_wrap=wide)
    for path in written:
        sys.stdout.write(f"{path}\n")
