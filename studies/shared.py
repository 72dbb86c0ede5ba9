"""What studies share: how they are asked, where the data are, and how answers are written."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.foundation.output import plain, write_json
from identifiability.report import Prose, Section, frame_table, write_page

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: Environment variable with the folder of the data sets.
VARIABLE = "IDENTIFIABILITY_DATA"


def data_folder(name: str, given: str | Path | None = None) -> Path:
    """Return the folder of a data set: in the given one, the environment's, or ../shared/data.

    The data have their own licences and are no part of this project.
    """
    return Path(given or os.environ.get(VARIABLE) or ROOT.parent / "shared" / "data") / name


def wilson(hits: float, of: float) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share [Wilson 1927]."""
    z2, share = 1.96**2, hits / of
    middle = (share + z2 / (2 * of)) / (1 + z2 / of)
    half = 1.96 / (1 + z2 / of) * np.sqrt(share * (1 - share) / of + z2 / (4 * of * of))
    return float(middle - half), float(middle + half)


def study_parser(name: str, text: str | None, quick: str) -> argparse.ArgumentParser:
    """Return the parser of a study, with ``--quick`` and ``--out`` (of JSON and page).

    Parameters
    ----------
    name : str
    text : str or None
        Its docstring.
    quick : str
        What a quick run does.
    """
    parser = argparse.ArgumentParser(prog=name, description=(text or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / f"{name}.json")
    parser.add_argument("--quick", action="store_true", help=quick)
    return parser


def write_answer(
    out: Path,
    title: str,
    statement: str,
    tables: Mapping[str, pd.DataFrame],
    text: str | None,
    data: Mapping[str, Any] | None = None,
) -> None:
    """Write a study's numbers as JSON and its page to the same folder; print where.

    Parameters
    ----------
    out : Path
    title, statement : str
    tables : mapping
        Heading → table.
    text : str or None
        The study's docstring, which says how it was done.
    data : mapping, optional
        Further numbers.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    rows = {heading: frame.to_dict("records") for heading, frame in tables.items()}
    print(write_json(out, plain({"statement": statement, **rows, **(data or {})})))
    sections = [
        Section(f"table-{k}", heading, "", (frame_table(frame),))
        for k, (heading, frame) in enumerate(tables.items())
    ]
    method = tuple((text or "").partition("\n\n")[2].split("\n\n"))
    sections.append(Section("method", "Method", "", (Prose(method),)))
    page = out.with_suffix(".html")
    print(write_page(title, statement, sections, page, overline="Study"))
