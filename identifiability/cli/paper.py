"""``identifiability paper``."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from identifiability.cli import common, options
from identifiability.cli.common import Writes

#: The studies, beside the package in a checkout, and where to get one.
STUDIES = Path(__file__).resolve().parents[2] / "studies"
SOURCE = "https://github.com/robot-identifiability/identifiability"


@options.command()
def paper(
    place: options.Place,
    tables: Annotated[list[str] | None, Argument()] = None,
    quick: bool = False,
    seeds: Annotated[int | None, Option(min=1)] = None,
    out: Annotated[Path, Option(), Writes()] = Path("reports"),
) -> None:
    """Compute every table and figure of the paper, ours beside the printed numbers.

    **You give** names of tables and figures, or none for all of them, or of other studies; this
    needs the source checkout. **You get** a page each and reports/index.html with what agrees, what
    does not, and why; the exit code is 1 if a required check fails. --quick takes few seeds;
    --resume goes on where it was stopped.

        identifiability paper --quick
        identifiability paper 3 figure4 --quick
        identifiability paper --seeds 400 --resume work
        identifiability paper coverage

    Parameters
    ----------
    tables
        Such as 3, table3, figure4 or coverage; all tables and figures by default.
    quick
        Few seeds and coarse grids.
    seeds
        Draws of the noise for every case (40; 4 if quick).
    out
        Folder of the reports.
    """
    with common.sentences():
        from identifiability.foundation.errors import IdentifiabilityError  # noqa: PLC0415

        if not (STUDIES / "registry.py").is_file():
            raise IdentifiabilityError(
                "The studies are part of the source checkout, in its folder 'studies', not of the "
                f"installed package: 'git clone {SOURCE}' and run 'identifiability paper' there, "
                "once it is installed from it ('pip install -e .')."
            )
    words = [*(tables or ()), "--out", str(out), *(["--quick"] if quick else [])]
    words += [] if seeds is None else ["--seeds", str(seeds)]
    runpy.run_path(str(STUDIES), {"words": words, "place": place}, "__main__")
