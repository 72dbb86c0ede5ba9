"""Rows for Table 7 from real robots whose logs are public, by the studies of those robots."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from shared import data_folder

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.workflows.analyze import Analysis


def _kuka(data: Path) -> Analysis:
    return import_module("kuka_lwr4").run_analysis(data, 1, "ols")


def _tx40(data: Path) -> Analysis:
    return import_module("staubli_tx40").run_analysis(data, "ols")


#: Robot → (name of its data set, how its log is analysed).
ROBOTS: dict[str, tuple[str, Callable[[Path], Analysis]]] = {
    "KUKA LWR4+": ("kuka_lwr4", _kuka),
    "Stäubli TX40": ("staubli_tx40", _tx40),
}


def real_rows(*, quick: bool = False) -> tuple[list[dict[str, Any]], list[str]]:
    """Return one row a robot and model, and a sentence for each robot that is missing."""
    rows: list[dict[str, Any]] = []
    missing = []
    for robot, (name, analyse) in ROBOTS.items():
        if quick:
            missing.append(f"{robot}: left out in a quick run.")
            continue
        try:
            folder = data_folder(name)
            if not folder.is_dir():
                missing.append(
                    f"{robot}: there is no data set '{name}' here; its study says where to get it."
                )
                continue
            rows += _rows(robot, analyse(folder))
        except (ImportError, AttributeError, TypeError, IdentifiabilityError) as error:
            missing.append(f"{robot}: its study cannot be run ({error}).")
    return rows, missing


def _rows(robot: str, analysis: Analysis) -> list[dict[str, Any]]:
    return [
        {
            "robot": robot,
            "model": m.name,
            "ε_RA [%]": 100 * m.error_ra,
            "held out [%]": 100 * m.error_ra_validation,
            "parameters / identified": f"{len(m.submodel)} / {m.estimate.paper_rule.sum()}",
            "signs": "possible" if m.feasible else "impossible",
        }
        for m in analysis.models
    ]
