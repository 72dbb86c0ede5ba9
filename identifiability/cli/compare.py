"""``identifiability compare``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from typer import Option

from identifiability.cli import common, options


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    ladder: options.Ladder = None


@options.command()
def compare(
    machine: options.Machine,
    recorded: options.Recorded,
    before: str,
    after: str,
    derived: options.Derived,
    outputs: options.Outputs,
    own: Options,
    more_before: Annotated[Sequence[str], Option("--before", metavar="LOG")] = (),
    more_after: Annotated[Sequence[str], Option("--after", metavar="LOG")] = (),
) -> None:
    """Say what changed between two logs, or two results, of one robot."""
    with common.sentences(), common.progress() as say:
        from identifiability.foundation.options import OptionError  # noqa: PLC0415
        from identifiability.workflows.compare import compare as find  # noqa: PLC0415

        first, second = [before, *more_before], [after, *more_after]
        say("reading logs", 0.0)
        sides = []
        for side in (first, second):
            results = [path for path in side if Path(path).suffix.lower() == ".json"]
            if results and len(side) > 1:
                raise OptionError(
                    f"{results[0]} is a result, and stands beside others; give one result on each "
                    "side, or logs alone."
                )
            sides.append(side[0] if results else side)
        say("comparing", 0.3)
        found = find(machine.load(recorded), *sides, preparation=derived.preparation(), **vars(own))
        written = outputs.write(found, say)
    common.print_end([found.statement])
    common.print_result(found, found.hints, written)
