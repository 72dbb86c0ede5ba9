"""``identifiability rollout``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    against: Annotated[
        str | None,
        Option(metavar="ROBOT|RESULT"),
        "Another robot, or what analyze or prune fitted to this one.",
    ] = None
    fit: Annotated[
        Sequence[str],
        "Logs to whose positions rotors, friction and offsets of the joints, and the delay, are "
        "fitted first, bodies as the file's.",
    ] = ()


@options.command(motion_alone=True)
def rollout(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: Annotated[
        list[str],
        "Logs with commands, `<joint>.cmd`, beside positions; torque is not looked at.",
    ],
    outputs: options.Outputs,
    own: Options,
    fitted: Annotated[
        Path | None, "Robot file to write with what was fitted.", Writes(".xml", ".urdf")
    ] = None,
    out: Annotated[
        Path | None,
        "File to write with positions sample by sample: .csv or .parquet.",
        options.Table,
    ] = None,
) -> None:
    """Move a robot by logged commands in a simulator, and say by how much its positions err."""
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.workflows.rollout import rollout as run  # noqa: PLC0415

        say("reading logs", 0.0)
        robot = machine.load(recorded)
        say("rolling out commands", 0.2)
        if fitted is not None and not own.fit:
            raise OptionError("--fitted writes what --fit finds; give logs to fit to.")
        found = run(robot, logs, **vars(own))
        more = [] if found.fitted is None else [(found.fitted.save, fitted)]
        written = outputs.write(found, say, (found.write, out), *more)
    common.print_result(found, [found.statement], written, "Error of positions (rms)")
