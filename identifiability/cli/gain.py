"""``identifiability gain``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from typer import Option

from identifiability.cli import common, options
from identifiability.foundation.options import Positive


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    loaded: Annotated[Sequence[str], Option("--loaded"), "Log with it."]
    mass: Annotated[Positive, Option(), "Of the load [kg]."]
    centre: Annotated[options.Point, "Its centre of mass in the frame of the body's joint [m]."] = (
        "0,0,0"
    )
    inertia: Annotated[
        options.Point, "Its moments of inertia about its centre, along these axes [kg·m²]."
    ] = "0,0,0"
    body: Annotated[str | None, "Which it is fixed to; by default the last one."] = None
    model: Annotated[
        options.Model,
        "Effects of the robot without the load; by default bodies, viscous and Coulomb friction, "
        "offsets and actuator inertia.",
    ] = None


@options.command()
def gain(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: Annotated[
        list[str], "Logs without the load; columns `<joint>.tau` or `<joint>.current` in any unit."
    ],
    derived: options.Derived,
    outputs: options.Outputs,
    own: Options,
) -> None:
    """Identify what one unit of each torque column is, from logs with and without a known load."""
    with common.sentences(), common.progress() as say:
        from identifiability.workflows.gains import identify_gains  # noqa: PLC0415

        say("reading logs", 0.0)
        result = identify_gains(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            **vars(own),
        )
        written = outputs.write(result, say)
    texts = [*filter(None, [result.sidecar]), result.statement, *result.hints]
    common.print_result(result, texts, written)
