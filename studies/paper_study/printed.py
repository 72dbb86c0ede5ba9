"""The numbers that the paper prints, one file a table."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "paper_data"


def read_printed(name: str) -> dict[str, Any]:
    """Return the printed numbers of ``table_3``, or another file of `FOLDER`."""
    return tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))


def printed_models(name: str) -> dict[str, dict[str, Any]]:
    """Return the rows of a table by the name of their model."""
    return {row["model"]: row for row in read_printed(name)["rows"]}
