"""``identifiability payload``."""

from __future__ import annotations

from typing import Any

from identifiability.cli import common, options


@options.command("workflows/payload.py")
def payload(
    machine: options.Machine,
    recorded: options.Recorded,
    result: options.JsonResult,
    logs: options.OtherLogs,
    outputs: options.Outputs,
    **own: Any,
) -> None:
    """Weigh what hangs on a body: its mass, centre and inertia, with intervals.

    **You give** the result of a fit to logs without the load (JSON of analyze, prune or diagnose)
    and logs with it; best also a log of the same motion without it, of the same day (*--without*):
    these are compared sample by sample, so that what the model gets wrong cancels.

        identifiability analyze arm.urdf empty.csv --json result.json
        identifiability payload arm.urdf result.json loaded.csv --without unloaded.csv

    **You get** mass, centre and moments about it of a real body, each with a 95 % interval and
    whether the logs tell it (*told*: yes, or why not). Intervals hold what the result does not know
    of the robot, what the noise of these logs remembers and, with several logs, how they scatter.
    No mass told? Move so that gravity and acceleration pull at the load in several directions.
    """
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.payload import payload as weigh  # noqa: PLC0415

        say("reading logs", 0.0)
        found = weigh(machine.load(recorded), result, logs, **own)
        written = outputs.write(found, say)
    common.print_end([found.answer])
    title = f"What hangs on {found.body}; moments about its centre"
    rest = [found.statement.removeprefix(found.answer).strip()]
    common.print_result(found, rest, written, title)
