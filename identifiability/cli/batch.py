"""``identifiability batch``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from identifiability.cli import common, options
from identifiability.cli.common import Reads, Writes

if TYPE_CHECKING:
    from identifiability.workflows.batch import Batch


@options.command("workflows/batch.py")
def batch(
    study: Annotated[str, Argument(metavar="STUDY.toml"), Reads("study", "TOML")],
    place: options.Place,
    out: Annotated[Path | None, Option(), Writes()] = None,
) -> None:
    """Ask the same of many robots: one table and one page over all, and a page each.

    **You give** a TOML file that says what is asked (*analyze*, *prune* or *diagnose*), of which
    robots, and which of their logs are fitted and judge, by pattern:

    ```
    verb = "analyze"

    [options]
    quick = true

    [[robots]]
    each = "fleet/*"
    file = "{each}/robot.urdf"
    train = "{each}/fit*.csv"
    validate = "{each}/unseen*.csv"
    ```

        identifiability batch fleet.toml --out results

    **You get** in the folder index.html, with a link to the page of each robot, and the same table
    as table.csv and table.json: verdicts, the model to use, its error on unseen motion, warnings.
    A robot that cannot be asked has one sentence in its row, and the command ends with code 1.

    **Interrupted?** The same command goes on: what is finished is not done again, and what has
    another log, robot file, option or program is.
    """
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
