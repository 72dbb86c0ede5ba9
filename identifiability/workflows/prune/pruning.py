"""`Pruning`: what was found on the way down from the unpruned model."""

from collections.abc import Mapping

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import Verdict
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import (
    LadderSource,
    Rung,
)
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.opening import Opening
from identifiability.workflows.prune.absorption import Absorption
from identifiability.workflows.prune.elimination import Refusal
from identifiability.workflows.prune.moves import Partition
from identifiability.workflows.prune.rung import PrunedRung
from identifiability.workflows.prune.selection import Criterion
from identifiability.workflows.prune.stability import Stability


@frozen(kw_only=True)
class Pruning(Opening):
    """The rungs from the unpruned model down, and which one to use.

    Attributes
    ----------
    information : Information
        About the base parameters.
    start : Rung
        The model that pruning started from.
    rungs : tuple of PrunedRung
        Unpruned model first.
    selected : int
        The rung to use.
    result : RungResult
        The rung to use with verdicts, uncertainties by resampling, and physical certificate.
    refused : tuple of Refusal
        Suggested moves that the data contradict.
    stability : Stability
    absorption : Absorption
    criterion, method, seed
        As asked for.
    least : int
        The rung with the least held-out error.
    source : LadderSource
        Where the model that pruning started from came from.
    settings : mapping
        Other options that decided the numbers.
    fitted, held_out : Prediction
        Torque predicted by the rung to use on the logs that were fitted, and on validation logs or,
        without any, on stretches (or logs) by models fitted to the others; sums only.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    """

    information: Information
    start: Rung
    rungs: tuple[PrunedRung, ...]
    selected: int
    result: RungResult
    refused: tuple[Refusal, ...]
    stability: Stability
    absorption: Absorption
    criterion: Criterion
    method: str
    seed: int
    least: int
    source: LadderSource
    settings: Mapping[str, object]
    fitted: Prediction
    held_out: Prediction
    nothing: str = ""

    @property
    def chosen(self) -> PrunedRung:
        """The rung to use."""
        return self.rungs[self.selected]

    @property
    def full(self) -> PrunedRung:
        """The unpruned model."""
        return self.rungs[0]

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the parameters of the rung to use."""
        return self.result.verdicts

    @property
    def feasible(self) -> bool:
        """Whether a real robot can have the values of the rung to use."""
        return self.result.feasible

    @property
    def partition(self) -> Partition:
        """What became of each column of the starting model."""
        return self.chosen.step.partition
