"""What a diagnosis is asked: `Rules` of naming, and the `Setting`."""

from typing import Annotated

from identifiability.foundation.options import Share, at_least, check_fields
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.structure import Structure


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
class Setting:
    """What is diagnosed, and from what.

    Attributes
    ----------
    structure : Structure
        The robot under the model that is diagnosed.
    samples, validation : tuple of Samples
        Fitted, and unseen.
    fixed : bool
        Whether the model keeps the values of the robot file.
    rules : Rules
    seed : int
    chosen_by : str
        What judged while names were chosen, in words.
    verified_on : str
        Unseen motion, in words: neither fitted nor used to choose.
    """

    structure: Structure
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...] = ()
    fixed: bool = False
    rules: Rules = Rules()
    seed: int = 0
    chosen_by: str = ""
    verified_on: str = ""
