"""`Rules` of naming, and the record of a `Step`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """Thresholds of naming.

    Attributes
    ----------
    level : float
        Family-wise error of each step.
    gain : float
        Least relative fall of the held-out error, joints weighted by their own.
    alias : float
        A candidate of which less than this share is outside the model is structurally aliased.
    confusable : float
        Canonical correlation from which on two names are given.
    most : int
        Steps at most.
    patience : int
        Steps without a fall of the held-out error after which the search ends.
    """

    level: float = 0.05
    gain: float = 0.002
    alias: float = 0.03
    confusable: float = 0.9
    most: int = 40
    patience: int = 4


@dataclass(frozen=True)
class Step:
    """One step of the selection.

    Attributes
    ----------
    evidence : mapping of (family, place) to score
        The best over shapes.
    critical : float
        Score that noise alone exceeds with the family-wise level.
    best : (family, place)
    p_value : float
        Family-wise.
    gain : float
        Relative fall of the held-out error; nan where not tried.
    accepted : bool
        Whether the effect is still there at the end.
    reason : str
    """

    evidence: dict[tuple[str, str], float]
    critical: float
    best: tuple[str, str]
    p_value: float
    gain: float
    accepted: bool
    reason: str
