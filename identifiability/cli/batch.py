"""``identifiability batch``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit

from identifiability.cli import common, options
from identifiability.cli.common import Reads, Writes

if TYPE_CHECKING:
    from identifiability.workflows.batch import Batch


@options.command()
def batch(
    study: Annotated[str, Argument(metavar="STUDY.toml"), Reads("study", "TOML")],
    place: options.Place,
    out: Annotated[Path | None, Writes()] = None,
) -> None:
    """Ask the same of many robots: one table and one page over all, and a page each."""
    with common.sentences(), common.progress() as say, place.running() as runner:
        from identifiability.workflows.batch import batch as run  # noqa: PLC0415

        result = run(study, out, engine=runner, progress=say)
    print_batch(result)
    if result.failed:
        raise Exit(1)


def print_batch(result: Batch) -> None:
    """Print a row a robot, the statement, what to do next, and where page and tables are."""
    from identifiability.workflows.batch import PAGE, TABLE  # noqa: PLC0415

    table = result.folder / TABLE
    written = [table, table.with_suffix(".json"), result.folder / PAGE]
    title = f"{result.name}: {result.verb}"
    common.print_result(result, [result.statement], written, title)
