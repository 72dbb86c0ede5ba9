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

    loaded: Annotated[Sequence[str], Option("--loaded")]
    mass: Annotated[Positive, Option()]
    centre: options.Point = "0,0,0"
    inertia: options.Point = "0,0,0"
    body: str | None = None
    model: options.Model = None


@options.command()
def gain(
    machine: options.Machine,
    recorded: options.Recorded,
    logs: list[str],
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
