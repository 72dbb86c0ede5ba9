"""`Findings`: where model and data disagree, and what is missing."""

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import NamedTuple

from identifiability.effects import title_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import state_mass
from identifiability.regression.columns import Refusal
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.problem import Alias, Setting
from identifiability.workflows.diagnose.rows import Discrepancy, Gap
from identifiability.workflows.gravity import Leaning

#: Names that are said of what cannot be told apart.
LISTED = 2


def call(names: list[str]) -> str:
    """Return a name with those that it cannot be told from, or how many these are."""
    some = f"{names[0]} or one of {len(names) - 1} that look like it"
    return some if len(names) > LISTED else " or ".join(names)


class Rival(NamedTuple):
    """Another name for the same rows: "A or B"."""

    family: str
    place: str


@frozen
class Placement:
    """A named effect at one place.

    Attributes
    ----------
    place : str
    shape : float
        nan for families without one.
    parameters, units : tuple of str
    values, errors : (k,)
        Of the mixed model, with standard errors.
    fitted : (k,)
        As an analysis weighs rows: those of the model that is written.
    rms : float [N·m or N]
        Of the torque that it adds at the joint where it is largest.
    rivals : tuple of Rival
    open : tuple of str
        Parameters that the motion determines together with others only: their values are the
        smallest of many.
    weight : float
        Its posterior probability among all that may be in its place.
    odds, unseen : float [nat]
        Log odds for it on the fitted motion, and what it gains on unseen motion.
    """

    place: str
    shape: float
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    errors: Array
    fitted: Array
    rms: float
    rivals: tuple[Rival, ...] = ()
    open: tuple[str, ...] = ()
    weight: float = 1.0
    odds: float = float("nan")
    unseen: float = float("nan")

    @property
    def rows(self) -> list[tuple[str, float, float, str]]:
        """Name, value, standard error and unit of each parameter."""
        values, errors = self.values.tolist(), self.errors.tolist()
        return list(zip(self.parameters, values, errors, self.units, strict=True))


@frozen
class Curve:
    """What an effect was learned to be, along the fitted motion.

    Attributes
    ----------
    title : str
    joint, of : int
        Actuated joint where it is largest, and joint whose motion it is drawn over.
    against : {"velocity", "position", "load", "time", "session"}
    x, learned, spread, data : (N,)
        Motion; torque of the effect, low-passed only where it remembers or is no function of one
        joint's motion, and its standard error; and the low-passed residual without the effect.
    """

    title: str
    joint: int
    of: int
    against: str
    x: Array
    learned: Array
    spread: Array
    data: Array


@frozen
class NamedEffect:
    """An effect that was found missing and added.

    Attributes
    ----------
    name, title : str
    placements : tuple of Placement
    before, after : float
        Held-out ε_RA of the model without and with it.
    interval : (float, float)
        95 % of the change.
    everywhere : bool
        Whether it is at all places where it can be.
    unnamed : bool
        Whether it is a function without a name.
    nearest : tuple of str
        Of such a function: the likeliest names in its stead.
    leaning : Leaning or None
        Where gravity points, if it is a tilted base.
    """

    name: str
    title: str
    placements: tuple[Placement, ...]
    before: float
    after: float
    interval: tuple[float, float]
    everywhere: bool = False
    unnamed: bool = False
    nearest: tuple[str, ...] = ()
    leaning: Leaning | None = None

    @property
    def confirmed(self) -> bool:
        """Whether unseen motion says so by itself."""
        return self.unseen >= ESTIMATION_RULES.keep

    @property
    def weight(self) -> float:
        """How sure the name is: the least posterior probability over its places."""
        return min(p.weight for p in self.placements)

    @property
    def odds(self) -> float:
        """Least log odds over its places [nat]."""
        return min(p.odds for p in self.placements)

    @property
    def unseen(self) -> float:
        """What it gains on unseen motion [nat]."""
        return min(p.unseen for p in self.placements)

    @property
    def joints(self) -> tuple[str, ...]:
        """Where it is."""
        return tuple(dict.fromkeys(p.place for p in self.placements))

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Families that the data do not tell from this one: the name is "A or B"."""
        rivals = [r for p in self.placements for r in p.rivals]
        return tuple(dict.fromkeys(r.family for r in rivals))

    @property
    def names(self) -> list[str]:
        """The name and its alternatives, in words."""
        return [self.title, *map(title_of, self.alternatives)]

    @property
    def called(self) -> str:
        """The same in few words: what is said first may not be surer."""
        return call(self.names)


@frozen
class Refuted:
    """What fitted motion named and unseen motion did not confirm; in no model.

    Attributes
    ----------
    name, place : str
    odds, unseen : float [nat]
        Log odds on the fitted motion, and what it gains on unseen motion.
    """

    name: str
    place: str
    odds: float
    unseen: float


@frozen
class Odds:
    """Log odds of a family at a place, or in all joints.

    Attributes
    ----------
    name, place : str
    before, after : float [nat]
        Beside the model, and beside what was named as well; nan of what was named itself.
    """

    name: str
    place: str
    before: float
    after: float


@frozen(kw_only=True)
class Findings(Setting):
    """Where model and data disagree, what is missing, and what adding it does.

    Attributes
    ----------
    effects : tuple of NamedEffect
        In order of addition; empty when nothing can be named.
    curves : tuple of Curve
        One for each named effect and place.
    gap : Gap
        Unseen rows: residual of the base model, then after each effect.
    error_before, error_after : float
        ε_RA on the fitted logs.
    held_before, held_after : float
        ε_RA on unseen motion.
    refuted : tuple of Refuted
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies : tuple of Discrepancy
        Where what is left of the fitted motion sits.
    aliases : tuple of Alias
    refusals : tuple of Refusal
    evidence : tuple of Odds
        Of all that was asked, the likeliest first.
    values : (b,)
        Base parameters of the diagnosed model, beside the named effects.
    model : Model
        The base model with the named effects.
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    nothing : str
        Why nothing was looked for, for after "because"; empty where it was.
    upright : Structure or None
        What was diagnosed, with gravity as the file states it, where it was found elsewhere first
        and `structure` is about that.
    """

    effects: tuple[NamedEffect, ...]
    curves: tuple[Curve, ...]
    gap: Gap
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    refuted: tuple[Refuted, ...]
    interval: tuple[float, float]
    discrepancies: tuple[Discrepancy, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    evidence: tuple[Odds, ...]
    values: Array
    model: Model
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    nothing: str = ""
    upright: Structure | None = None
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def diagnosed(self) -> Structure:
        """The robot as its file has it, under the model that was diagnosed."""
        return self.structure if self.upright is None else self.upright

    @property
    def base(self) -> tuple[str, ...]:
        """Names of the effects of the model that was diagnosed."""
        return self.diagnosed.model.names

    @cached_property
    def completed(self) -> Structure:
        """The robot under the model with the named effects."""
        known = None if self.forward is None else self.forward.nearest
        return Structure.of(self.robot, self.model) if known is None else known.structure

    @property
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        known = None if self.forward is None else self.forward.nearest
        return "" if known is None else state_mass(self.robot, known.values, known.cad_weight)
