"""`Rules` of naming, and the record of a `Step`."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.options import Share, at_least, check_fields
from identifiability.foundation.values import frozen


@frozen
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

    level: Share = 0.05
    gain: Share = 0.002
    alias: Share = 0.03
    confusable: Share = 0.9
    most: Annotated[int, at_least(1)] = 40
    patience: Annotated[int, at_least(1)] = 4

    def __post_init__(self) -> None:
        check_fields(self)


@frozen
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
