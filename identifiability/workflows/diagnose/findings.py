"""`Findings`: where model and data disagree, and what is missing."""

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

from identifiability.effects import Effect
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.aliases import Alias
from identifiability.workflows.diagnose.find import Discrepancy
from identifiability.workflows.diagnose.forward_gap import ForwardGap
from identifiability.workflows.diagnose.held_out import Gap
from identifiability.workflows.diagnose.named_effect import Curve, NamedEffect
from identifiability.workflows.diagnose.remainder import Remainder
from identifiability.workflows.diagnose.rows import Refusal
from identifiability.workflows.diagnose.rules import Rules, Step


@frozen
class Findings:
    """Where model and data disagree, what is missing, and what adding it does.

    Attributes
    ----------
    structure : Structure
        The robot under the model that was diagnosed.
    fixed : bool
        Whether that kept the values of the robot file.
    effects : tuple of NamedEffect
        In order of addition; empty when nothing can be named.
    refuted : tuple of NamedEffect
        What the fitted motion named and the motion that verifies surely contradicts, each beside
        what was named then; in no model.
    error_before, error_after : float
        ε_RA on the fitted logs.
    held_before, held_after : float
        ε_RA on unseen motion.
    interval : (float, float)
        95 % of the change on unseen motion.
    real_before, real_after : float
        ε_RA on unseen motion where every fit is a real robot; nan where the model has no bodies
        or keeps its values.
    chosen_by : str
        What judged while names were chosen, in words.
    verified_on : str
        Unseen motion, in words: neither fitted nor used to choose.
    discrepancies, discrepancies_after : tuple of Discrepancy
    aliases : tuple of Alias
    refusals : tuple of Refusal
    steps : tuple of Step
    remainder : Remainder
    model : Model
        The base model with the named effects.
    samples, validation : tuple of Samples
        Fitted, and unseen.
    gap : Gap
        Unseen rows: residual of the base model, then after each effect.
    curves : tuple of Curve
        One for each named effect and place.
    rules : Rules
    seed : int
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    """

    structure: Structure
    fixed: bool
    effects: tuple[NamedEffect, ...]
    refuted: tuple[NamedEffect, ...]
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    interval: tuple[float, float]
    real_before: float
    real_after: float
    chosen_by: str
    verified_on: str
    discrepancies: tuple[Discrepancy, ...]
    discrepancies_after: tuple[Discrepancy, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    steps: tuple[Step, ...]
    remainder: Remainder
    model: Model
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...]
    gap: Gap
    curves: tuple[Curve, ...]
    rules: Rules
    seed: int
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects of the model that was diagnosed."""
        return self.structure.model.names

    @cached_property
    def completed(self) -> Structure:
        """The robot under the model with the named effects."""
        return Structure.of(self.robot, self.model)

    @property
    def base_effects(self) -> tuple[Effect, ...]:
        """Effects of the model that was diagnosed."""
        return self.structure.model.effects
