"""Torque columns that are exchanged or have the wrong sign (`regression.mix_up`)."""

from __future__ import annotations

from identifiability.regression.mix_up import find_mix_up
from identifiability.workflows.oddities.evidence import Evidence


def find_turned_torque(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on torque columns that are mixed up, or none."""
    structure = evidence.structure
    regression = structure.regression(evidence.samples)
    return tuple(filter(None, [find_mix_up(regression, structure.base.nonnegative)]))
