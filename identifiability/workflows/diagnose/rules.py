"""`Rules`: every number by which a diagnosis decides, each with its source or calibration."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from identifiability.foundation.options import Share, at_least, check_fields
from identifiability.foundation.values import frozen


@frozen
class Rules:
    """Thresholds of a diagnosis.

    Attributes
    ----------
    level : float
        A part is stated where the odds for it are (1 - level) / level at least, 19 to 1 by default;
        and names that together have that share of the probability are listed as "A or B".
    size : float
        Typical size of an effect, as a share of its joint's torque (rms): the scale of the normal
        prior of its parameters. Friction laws, springs and ripples that were published for real
        arms are within a factor of three of it; the factor costs a nat.
    alias : float
        A candidate of which less than this share is outside the model is structurally aliased.
    function : float [nat]
        What a function without a name must explain beyond a name, about one column more.
    crowd : float [nat]
        Price of a second special effect over the same variable in the same joint: as much as the
        level asks, so that two names for one curve are rarer than one.
    block : float [s]
        Blocks over which scores and errors are taken as independent: five memories of the noise of
        usual arms.
    similar : float
        Similarity from which on a motion is asked for that tells two names apart.
    beam : int
        Hypotheses that are kept while searching.
    options : int
        Moves of one kind that are tried from each.
    hidden : int
        Parts that are tried beside rows as they leave them themselves, where no move gains.
    most : int
        Parts of a hypothesis at most.
    instants : int
        Instants of a log at most at which something may change, `block` apart at least.
    """

    level: Share = 0.05
    size: Share = 0.05
    alias: Share = 0.03
    function: float = 3.0
    crowd: float = 3.0
    block: float = 0.5
    similar: Share = 0.9
    beam: Annotated[int, at_least(1)] = 5
    options: Annotated[int, at_least(1)] = 6
    hidden: Annotated[int, at_least(0)] = 3
    most: Annotated[int, at_least(1)] = 24
    instants: Annotated[int, at_least(2)] = 40

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def odds(self) -> float:
        """Log odds from which on a part is stated [nat]."""
        return float(np.log(1.0 / self.level - 1.0))
