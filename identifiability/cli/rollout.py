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

    against: Annotated[str | None, Option(metavar="ROBOT|RESULT")] = None
    fit: Sequence[str] = ()


@options.command(motion_alone=True)
def rollout(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: list[str],
    outputs: options.Outputs,
    own: Options,
    fitted: Annotated[Path | None, Writes(".xml", ".urdf")] = None,
    out: Annotated[Path | None, options.Table] = None,
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
    common.print_result(found, [found.statement, *found.hints], written, "Error of positions (rms)")
