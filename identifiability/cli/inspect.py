"""``identifiability inspect``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

if TYPE_CHECKING:
    from identifiability.workflows.inspect import Inspection


@options.command("workflows/inspect.py")
def inspect(
    machine: options.Machine,
    recorded: options.Recorded,
    outputs: options.Outputs,
    derived: options.Derived,
    place: options.Place,
    logs: Annotated[list[str] | None, Argument()] = None,
    template: Annotated[Path | None, Option(), Writes(".csv")] = None,
    **own: Any,
) -> None:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd about them.

    **Without logs**: the joints and which of them have motors, the columns that a log must have,
    the base parameters, and what only a sidecar can say. **With logs**: rates, gaps, resolution,
    bandwidth, saturation, the size of the torque beside that which the file's masses ask for, and
    whatever contradicts robot file, limits or physics; the page draws every joint over time.

        identifiability inspect 3-rps
        identifiability inspect arm.urdf --template log.csv
        identifiability inspect arm.urdf run.csv --report inspection.html

    Look here first when a log does not get in, or when *analyze* answers what you do not believe.

    Parameters
    ----------
    template
        CSV to write with the columns that a log must have.
    """
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.inspect import inspect as run  # noqa: PLC0415

        given = logs or []
        result = run(
            machine.load(recorded),
            given,
            preparation=derived.preparation(),
            progress=say,
            engine=place.stated(runner),
            **own,
        )
        written = outputs.write(result, say, (result.write_template, template))
    print_inspection(result, written)


def print_inspection(result: Inspection, written: Iterable[Path]) -> None:
    """Print the joints, or what the logs hold of them, what is odd, what is next, and the paths."""
    hints = result.hints
    if not result.records:
        hints = tuple(f"{n.text} {n.line}".strip().replace("\n", " ") for n in result.needs)
    common.print_result(result, [result.statement, *hints], list(written))
