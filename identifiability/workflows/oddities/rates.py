"""Velocities or accelerations that contradict what they are derived from."""

from __future__ import annotations

from identifiability.workflows.oddities.evidence import Evidence


def find_wrong_rates(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on given derivatives of another motion, or none."""
    found = [
        f"in {s.name} {note}" for s in evidence.samples for note in s.notes if CONTRADICTS in note
    ]
    if not found:
        return ()
    return (f"A derivative contradicts its position: {'; '.join(found[:3])}.",)


#: What such a note holds (`logs.units.find_contradictions`).
CONTRADICTS = "' contradicts '"
