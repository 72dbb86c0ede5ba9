"""``identifiability inspect``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument

from identifiability.cli import common, options
from identifiability.cli.common import Writes

if TYPE_CHECKING:
    from identifiability.workflows.inspect import Inspection


@dataclass(frozen=True)
class Options:
    """What is asked for."""

    model: options.Model = None


@options.command()
def inspect(
    machine: options.Machine,
    recorded: options.Recorded,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    own: Options,
    logs: Annotated[Sequence[str], Argument()] = (),
    template: Annotated[Path | None, Writes(".csv")] = None,
) -> None:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.inspect import inspect as run  # noqa: PLC0415

        result = run(
            machine.load(recorded),
            logs,
            preparation=derived.preparation(),
            progress=say,
            engine=place.stated(runner),
            **vars(own),
        )
        written = outputs.write(result, say, (result.write_template, template))
    print_inspection(result, written)


def print_inspection(result: Inspection, written: Iterable[Path]) -> None:
    """Print the joints, or what the logs hold of them, what is odd, what is next, and the paths."""
    hints = result.hints
    if not result.records:
        hints = tuple(f"{n.text} {n.line}".strip().replace("\n", " ") for n in result.needs)
    common.print_result(result, [result.statement, *hints], list(written))
