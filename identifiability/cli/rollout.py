"""``identifiability rollout``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@options.command("workflows/rollout.py", motion_alone=True)
def rollout(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.OtherLogs,
    outputs: options.Outputs,
    fitted: Annotated[Path | None, Option(), Writes(".xml", ".urdf")] = None,
    out: Annotated[Path | None, Option(), Writes(".csv", ".parquet", ".pq")] = None,
    **own: Any,
) -> None:
    """Move a robot by logged commands in a simulator, and say by how much its positions err.

    **You give** a robot whose joints have position servos (`<position>` actuators of an MJCF, or
    `[servo]` in the sidecar), and logs with commands beside positions: `<joint>.cmd` (or `q_des`,
    `target`, `action` …) and `<joint>.q`. With --against another robot, or the JSON that analyze
    or prune wrote, is moved by the same commands.

        identifiability rollout quadruped run.csv --report rollout.html
        identifiability rollout robot.xml unseen.csv --fit run.csv --fitted fitted.xml
        identifiability rollout robot.xml unseen.csv --against fitted.xml --out positions.csv

    **You get** the error of each joint's positions [mrad or mm], over whole logs and over windows
    of one second that begin with what was measured. Use logs that were not fitted.

    With --fit rotors, friction and offsets of the joints, and the delay of commands, are fitted to
    the positions of other logs first, bodies as the file's; *analyze* says which of these numbers
    the logs determine, and fits bodies, too.

    Parameters
    ----------
    fitted
        Robot file to write with what was fitted.
    out
        File to write with positions sample by sample: .csv or .parquet.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.workflows.rollout import rollout as run  # noqa: PLC0415

        say("reading logs", 0.0)
        robot = machine.load(recorded)
        say("rolling out commands", 0.2)
        if fitted is not None and not own["fit"]:
            raise OptionError("--fitted writes what --fit finds; give logs to fit to.")
        found = run(robot, logs, **own)
        more = [] if found.fitted is None else [(found.fitted.save, fitted)]
        written = outputs.write(found, say, (found.write, out), *more)
    common.print_result(found, [found.statement], written, "Error of positions (rms)")
