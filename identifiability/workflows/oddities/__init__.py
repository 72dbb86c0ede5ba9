"""What is odd: where robot file, limits and physics contradict a log, each in one sentence.

One file a family of oddity; each gives sentences that name the column and the remedy, and none for
good logs (`studies/false_hints.py` counts). What can be mended is mended when logs are read, and
said there: wrong samples (`logs.mend`), wrapped angles (`logs.wraps`), repeated rows.
"""

from __future__ import annotations

from identifiability.regression.mix_up import find_mix_up
from identifiability.workflows.oddities.effort import find_weightless
from identifiability.workflows.oddities.evidence import Evidence
from identifiability.workflows.oddities.frozen import find_frozen
from identifiability.workflows.oddities.late import find_late
from identifiability.workflows.oddities.saturation import find_saturation
from identifiability.workflows.oddities.time_scale import find_time_scale
from identifiability.workflows.oddities.torque_scale import find_torque_scale

__all__ = ["Evidence", "find_mixed", "find_oddities"]


def find_mixed(evidence: Evidence) -> str:
    """Return one sentence on torque columns that are exchanged or of the wrong sign, or nothing."""
    structure = evidence.structure
    return find_mix_up(structure.regression(evidence.samples), structure.base.nonnegative)


def find_oddities(evidence: Evidence, mixed: str = "") -> tuple[str, ...]:
    """Return what is odd about logs, a sentence each.

    Parameters
    ----------
    evidence : Evidence
    mixed : str
        What `find_mixed` said: exchanged columns explain whatever contradicts physics.
    """
    raw = (*find_frozen(evidence), *find_saturation(evidence))
    if mixed:
        return raw
    # The first that contradicts physics explains the others.
    finders = (find_time_scale, find_torque_scale, find_weightless, find_late)
    return (*raw, *next(filter(None, (find(evidence) for find in finders)), ()))
