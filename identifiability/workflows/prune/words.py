"""Pruning in words and as a ladder file."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import listing
from identifiability.workflows.analyze.words import state_physics
from identifiability.workflows.prune.pruning import Pruning


def statement(ladder: Pruning) -> str:
    """Return the answer in plain words."""
    chosen, full = ladder.chosen, ladder.full
    if ladder.nothing:
        return f"Nothing is identifiable, because {ladder.nothing}."
    if len(chosen) == len(full):
        text = (
            f"Nothing was pruned: each of the {len(full)} parameters of the model is needed to "
            "predict motion that the fit has not seen."
        )
    else:
        text = (
            f"Of {len(full)} parameters {len(chosen)} are worth using: "
            f"{listing(chosen.columns, 14)}. "
            f"{_identifiable(ladder)}. They predict unseen motion with an error of "
            f"{_percent(chosen.error_ra_unseen)}, the unpruned model with "
            f"{_percent(full.error_ra_unseen)}."
        )
    if np.isfinite(chosen.error_ra_validation):
        text += (
            f" On the logs held out for validation it is "
            f"{_percent(chosen.error_ra_validation)} against {_percent(full.error_ra_validation)}."
        )
    return f"{text} {state_physics(ladder.robot, ladder.result)}"


def _identifiable(ladder: Pruning) -> str:
    if ladder.result.unjudged:
        return f"None of them is judged. {ladder.result.unjudged.removesuffix('.')}"
    count = ladder.result.count(Class.IDENTIFIABLE)
    total = len(ladder.chosen)
    return "All are identifiable" if count == total else f"{count} of them are identifiable"


def _percent(error: float) -> str:
    return f"{100 * error:.3g} %" if np.isfinite(error) else "unknown size"
