"""``identifiability rollout``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command
def rollout(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.Logs,
    outputs: options.Outputs,
    against: Annotated[str | None, Option(metavar="ROBOT|RESULT")] = None,
    out: Annotated[Path | None, Option(), Writes(".csv", ".parquet", ".pq")] = None,
) -> None:
    """Move a robot by logged commands in a simulator, and say by how much its positions err.

    **You give** a robot whose joints have position servos (`<position>` actuators of an MJCF, or
    `[servo]` in the sidecar), and logs with commands beside positions: `<joint>.cmd` (or `q_des`,
    `target`, `action` …) and `<joint>.q`. With --against another robot, or the JSON that analyze
    or prune wrote, is moved by the same commands.

        identifiability rollout quadruped run.csv --report rollout.html
        identifiability rollout robot.xml unseen.csv --against fitted.xml --out positions.csv

    **You get** the error of each joint's positions [mrad or mm], over whole logs and over windows
    of one second that begin with what was measured. Use logs that were not fitted.

    Parameters
    ----------
    against
        Another robot file, or a result of this robot (.json).
    out
        File to write with positions sample by sample: .csv or .parquet.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.rollout import rollout as run  # noqa: PLC0415

        say("reading logs", 0.0)
        robot = machine.load(recorded)
        say("rolling out commands", 0.2)
        found = run(robot, logs, against)
        written = ([] if out is None else [found.write(out)]) + outputs.write(found, say)
    names = [run.name for run in found.runs]
    headings = ("joint", *(h for n in names for h in (n, "1 s windows")), "unit")
    units = [{"N": "mm"}.get(unit, "mrad") for unit in found.robot.torque_units]
    cells = [
        [f"{1e3 * x:.3g}" for pair in zip(whole, short, strict=True) for x in pair]
        for whole, short in zip(found.errors.T, found.window_errors.T, strict=True)
    ]
    rows = [
        (joint, *own, unit)
        for joint, own, unit in zip(found.robot.joints, cells, units, strict=True)
    ]
    common.print_table("Error of positions (rms)", headings, rows, left=("joint", "unit"))
    common.print_end([found.statement], written)
