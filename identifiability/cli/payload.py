"""``identifiability payload``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identifiability.cli import common, options
from identifiability.foundation.options import Positive


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    without: Sequence[str] = ()
    body: str | None = None
    mass: Positive | None = None
    centre: options.Point | None = None
    inertia: options.Point | None = None


@options.command()
def payload(
    machine: options.Machine,
    recorded: options.Recorded,
    result: options.JsonResult,
    logs: list[str],
    outputs: options.Outputs,
    own: Options,
) -> None:
    """Weigh what hangs on a body: its mass, centre and inertia, with intervals."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.payload import payload as weigh  # noqa: PLC0415

        say("reading logs", 0.0)
        found = weigh(machine.load(recorded), result, logs, **vars(own))
        written = outputs.write(found, say)
    common.print_end([*filter(None, [found.sidecar]), found.statement])
    common.print_result(found, found.hints, written)
