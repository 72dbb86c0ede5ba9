"""``identifiability demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from identifiability.cli import options
from identifiability.cli.analyze import print_analysis
from identifiability.cli.common import check_outputs, progress, sentences, write_results


def demo(
    quick: Annotated[bool, typer.Option(help="100 samples instead of 750.")] = False,
    folder: Annotated[Path, typer.Option(help="Where to write demo.html and demo.json.")] = Path(
        "reports"
    ),
    seed: options.Seed = 0,
) -> None:
    """Run the main job on a simulated robot: the paper's 3-RPS with the paper's noise.

    Models 1 to 4 are fitted to one trajectory and validated on another; the report is
    reports/demo.html.
    """
    with sentences(), progress() as say:
        from identifiability.cli.demo_run import run_demo  # noqa: PLC0415

        folder.mkdir(parents=True, exist_ok=True)
        report, json = folder / "demo.html", folder / "demo.json"
        check_outputs(report, json)
        result = run_demo(quick=quick, seed=seed, progress=say)
        written = write_results(result, report, json, say)
    print_analysis(result, written)
