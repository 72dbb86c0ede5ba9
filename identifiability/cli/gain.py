"""``identifiability gain``."""

from __future__ import annotations

from typing import Any

from identifiability.cli import common, options


@options.command("workflows/gains.py:identify_gains", loaded="--loaded")
def gain(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: options.OtherLogs,
    derived: options.Derived,
    outputs: options.Outputs,
    **own: Any,
) -> None:
    """Identify what one unit of each torque column is, from logs with and without a known load.

    Currents tell torque up to a factor of each joint, and so do sensors that nobody calibrated.
    Fix a load that you have weighed to the last body, and move as before: one log without it, one
    with it. What is printed goes into the robot's sidecar.

    **You get** N·m per unit of each column, with its interval. *weak* and *not identifiable* gains
    saw too little of the load: hold it where it weighs on that joint.

        identifiability gain arm.urdf empty.csv --loaded loaded.csv --mass 2.5 --centre 0,0,0.08
    """
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.gains import identify_gains  # noqa: PLC0415

        say("reading logs", 0.0)
        result = identify_gains(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            **own,
        )
        written = outputs.write(result, say)
    texts = [*filter(None, [result.sidecar]), result.statement, *result.hints]
    common.print_result(result, texts, written)
