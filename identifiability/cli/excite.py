"""``identifiability excite``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from identifiability.cli import common, options


@options.command
def excite(
    machine: options.Machine,
    out: Annotated[
        Path,
        Option(
            help="File to write: .json (coefficients; 'simulate ROBOT FILE.json' follows it) or "
            ".csv (one period of t, JOINT.q, JOINT.dq, JOINT.ddq)."
        ),
    ],
    harmonics: Annotated[int, Option(min=1, max=50, help="Harmonics of the Fourier series.")] = 5,
    duration: Annotated[float, Option(help="Period of the motion [s].")] = 7.5,
    samples: Annotated[int, Option(min=5, help="Samples a period, all checked.")] = 750,
    limits: Annotated[
        Path | None,
        Option(
            help="TOML with JOINT = {q = [low, high], v = speed, a = acceleration} and "
            "[workspace.BODY] x, y, z = [low, high]; replaces the robot's own."
        ),
    ] = None,
    criterion: Annotated[
        Literal["condition", "information", "separate"] | None,
        Option(
            help="Condition number, information about parameters, or separation of two effects; "
            "default: what the other options suggest."
        ),
    ] = None,
    start_from: Annotated[
        list[str] | None,
        Option(help="Log that was measured already; find what to measure next. Repeatable."),
    ] = None,
    parameter: Annotated[
        list[str] | None, Option(help="Base parameter that the information is about. Repeatable.")
    ] = None,
    separate: Annotated[
        list[str] | None,
        Option(help="Effect to tell from another, as NAME or NAME@JOINT; give it twice."),
    ] = None,
    model: options.Model = None,
    evaluations: Annotated[
        int, Option(min=1, help="Motions that the search looks at, at most.")
    ] = 15_000,
    time_limit: Annotated[
        float | None,
        Option(help="Stop after this time [s]; the motion then depends on the machine."),
    ] = None,
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
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.errors import OutputError  # noqa: PLC0415
        from identifiability.workflows.excite import excite as run  # noqa: PLC0415

        common.check_outputs(out, report, inputs=[*machine.files, limits, *(start_from or ())])
        if out.suffix.lower() not in (".json", ".csv"):
            raise OutputError(f"'{out}' is neither .json nor .csv; give it one of these endings.")
        result = run(
            machine.load(),
            harmonics=harmonics,
            duration=duration,
            samples=samples,
            limits=limits,
            criterion=criterion,
            parameters=parameter,
            model=options.split_model(model),
            start_from=start_from or None,
            separate=separate,
            evaluations=evaluations,
            time_limit=time_limit,
            seed=seed,
            progress=say,
        )
        json = out.suffix.lower() == ".json"
        first = result.to_json(out) if json else result.write_motion(out)
        written = [first, *options.Outputs(report).write(result, say)]
    headings = ("joint", "from", "to", "speed", "of", "acceleration", "of")
    shown = ("least", "largest", "speed", "speed_limit", "acceleration", "acceleration_limit")
    rows = [
        (str(row["joint"]), *(f"{row[key]:.3g}" for key in shown))
        for row in result.to_frame().to_dict("records")
    ]
    common.print_table(f"{result.robot.title}: the motion", headings, rows, left=("joint",))
    common.print_end([result.statement, *result.hints], written)
