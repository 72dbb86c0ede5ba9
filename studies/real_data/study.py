"""What the studies of real logs share: where the data are, and how results are written."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identifiability.foundation.output import write_json
from identifiability.workflows.analyze import Analysis

#: The checkout.
ROOT = Path(__file__).resolve().parents[2]

#: Sidecars and ladders of the robots.
FOLDER = Path(__file__).resolve().parent

#: Environment variable with the folder of the data sets.
VARIABLE = "IDENTIFIABILITY_DATA"


def data_folder(name: str, given: str | Path | None = None) -> Path:
    """Return the folder of a data set: in the given one, the environment's, or ../shared/data.

    The data have their own licences and are no part of this project.
    """
    return Path(given or os.environ.get(VARIABLE) or ROOT.parent / "shared" / "data") / name


def read_arguments(name: str, question: str, argv: Sequence[str] | None) -> argparse.Namespace:
    """Return ``data`` (an existing folder), ``out`` and ``quick``."""
    parser = argparse.ArgumentParser(prog=name, description=question)
    parser.add_argument("--data", help=f"folder of the data sets (default: ${VARIABLE})")
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / f"{name}.json")
    parser.add_argument("--quick", action="store_true", help="the main comparison only")
    arguments = parser.parse_args(argv)
    arguments.data = data_folder(name, arguments.data)
    if not arguments.data.is_dir():
        parser.error(f"there is no folder {arguments.data}; give --data or set {VARIABLE}")
    return arguments


def write_study(out: Path, result: dict[str, Any], analysis: Analysis) -> None:
    """Write the figures as JSON and the report of an analysis as HTML beside it; print where."""
    out.parent.mkdir(parents=True, exist_ok=True)
    print(f"\n{write_json(out, result)}")
    print(analysis.write_report(out.with_suffix(".html")))
