"""``identifiability paper``."""

from __future__ import annotations

import runpy
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from typer import Argument

from identifiability.cli import common, options
from identifiability.cli.common import Writes
from identifiability.foundation.options import Count

#: The studies, beside the package in a checkout, and where to get one.
STUDIES = Path(__file__).resolve().parents[2] / "studies"
SOURCE = "https://github.com/robot-identifiability/identifiability"


@options.command()
def paper(
    place: options.Place,
    tables: Annotated[Sequence[str], Argument()] = (),
    quick: bool = False,
    seeds: Count | None = None,
    out: Annotated[Path, Writes()] = Path("reports"),
) -> None:
    """Compute every table and figure of the paper, ours beside the printed numbers."""
    with common.sentences():
        from identifiability.foundation.errors import IdentifiabilityError  # noqa: PLC0415

        if not (STUDIES / "registry.py").is_file():
            raise IdentifiabilityError(
                "The studies are part of the source checkout, in its folder 'studies', not of the "
                f"installed package: 'git clone {SOURCE}' and run 'identifiability paper' there, "
                "once it is installed from it ('pip install -e .')."
            )
    words = [*tables, "--out", str(out), *(["--quick"] if quick else [])]
    words += [] if seeds is None else ["--seeds", str(seeds)]
    runpy.run_path(str(STUDIES), {"words": words, "place": place}, "__main__")
