"""``identifiability paper``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

#: The studies of the paper, beside the package in a checkout.
STUDIES = Path(__file__).resolve().parents[2] / "studies"


@options.command()
def paper(
    place: options.Place,
    tables: Annotated[list[str] | None, Argument()] = None,
    quick: bool = False,
    seeds: Annotated[int | None, Option(min=1)] = None,
    out: Annotated[Path, Option(), Writes()] = Path("reports"),
) -> None:
    """Compute every table and figure of the paper, ours beside the printed numbers.

    **You give** names of tables and figures, or none for all of them; this needs the source
    checkout. **You get** a page each and reports/index.html with what agrees, what does not, and
    why; the exit code is 1 if a required check fails. --quick takes few seeds; --resume goes on
    where it was stopped.

        identifiability paper --quick
        identifiability paper 3 figure4 --quick
        identifiability paper --seeds 400 --resume work

    Parameters
    ----------
    tables
        Tables and figures, such as 3, table3 or figure4; all by default.
    quick
        Few seeds and coarse grids.
    seeds
        Draws of the noise for every case (40; 4 if quick).
    out
        Folder of the reports.
    """
    with common.sentences():
        from identifiability.foundation.errors import IdentifiabilityError  # noqa: PLC0415

        if not (STUDIES / "paper_study").is_dir():
            raise IdentifiabilityError(
                "The studies of the paper are part of the source checkout, in its folder "
                "'studies', not of the installed package; run 'identifiability paper' there."
            )
        sys.path.insert(0, str(STUDIES))
        from paper_study.command import Options, find_studies, print_result, run_studies  # type: ignore[import-not-found]  # noqa: PLC0415

        try:
            names = find_studies(tables or ())
        except KeyError as error:
            raise IdentifiabilityError(str(error.args[0])) from None
        with common.progress() as say, place.running() as runner:
            results = run_studies(names, Options(quick, seeds, runner, progress=say), out)
    for result in results:
        print_result(result, out)
    typer.echo(out / "index.html")
    if not all(r.passed for r in results):
        raise typer.Exit(1)
