"""`Findings`: where model and data disagree, and what is missing."""

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

import numpy as np

from identifiability.effects import Effect, title_of
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import state_mass
from identifiability.regression.columns import Refusal
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.gap import Discrepancy, Gap, Remainder
from identifiability.workflows.diagnose.problem import Alias, Setting
from identifiability.workflows.diagnose.search import SearchStep
from identifiability.workflows.gravity import Leaning

#: Similarity from which on two effects, or a direction of one and of another, are the same torque.
SAME: Tolerance = 1.0 - 1e-6


@frozen
class Rival:
    """Another name for the same rows.

    Attributes
    ----------
    family, place : str
    similarity : float
        Largest canonical correlation with what was named, beside the rest of the model.
    undecided : bool
        Whether it is among the likeliest names that together are as sure as a name must be.
    contains : bool
        Whether it can be all in this motion that what was named can be.
    weight : float
        Its posterior probability among the names for these rows.
    """

    family: str
    place: str
    similarity: float
    undecided: bool
    contains: bool = False
    weight: float = 0.0


@frozen
class Nearest:
    """A name beside a function without one.

    Attributes
    ----------
    title : str
    worse : float
        By how much unseen motion is predicted worse with it in the function's stead, as a share.
    """

    title: str
    worse: float


@frozen
class Shown:
    """What unseen motion shows of an effect at the joints where it is.

    Attributes
    ----------
    before, after : float
        Error over each of these joints' own scale, without and with the effect.
    interval : (float, float)
        95 % of the change.
    expected : float
        The change that an effect of the fitted size would bring; zero or less.
    odds : float [nat]
        Logarithm of the predictive likelihood ratio, with the effect over without.
    """

    before: float
    after: float
    interval: tuple[float, float]
    expected: float
    odds: float = 0.0


@frozen
class Placement:
    """A named effect at one place.

    Attributes
    ----------
    place : str
    shape : float
        nan for families without one.
    p_value : float
        Share of simulated noises in which anything is as likely, an upper bound where none is.
    parameters, units : tuple of str
    values, errors : (k,)
        Generalised least squares, with standard errors.
    rms : float [N·m or N]
        Of the torque that it adds at the joint where it is largest.
    rivals : tuple of Rival
    open : tuple of str
        Parameters that the motion determines together with others only: their values are the
        smallest of many.
    weight : float
        Its posterior probability among the names for these rows.
    odds : float [nat]
        Log odds for it on the fitted motion.
    scatter : float
        How much more its scores scatter from block to block than noise lets them.
    prior : (k,)
        Standard deviation that its parameters have beforehand, of functions alone.
    """

    place: str
    shape: float
    p_value: float
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    errors: Array
    rms: float
    rivals: tuple[Rival, ...]
    open: tuple[str, ...] = ()
    weight: float = 1.0
    odds: float = float("nan")
    scatter: float = 1.0
    prior: Array = field(default_factory=lambda: np.empty(0))

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
    joints_before, joints_after, joints_interval
        The same of the error over each joint's own scale.
    shown : Shown
        The same at the joints where it is: elsewhere other errors may hide it.
    real : (float, float)
        The same where every fit is a real robot; nan without bodies or with values that are kept.
    unnamed : bool
        Whether it is a function without a name.
    nearest : tuple of Nearest
        Names in the stead of such a function.
    why : str
        What refuted it, of what was.
    leaning : Leaning or None
        Where gravity points, if it is a tilted base.
    """

    name: str
    title: str
    placements: tuple[Placement, ...]
    before: float
    after: float
    interval: tuple[float, float]
    joints_before: float
    joints_after: float
    joints_interval: tuple[float, float]
    shown: Shown
    real: tuple[float, float] = (float("nan"), float("nan"))
    unnamed: bool = False
    nearest: tuple[Nearest, ...] = ()
    why: str = ""
    leaning: Leaning | None = None

    @property
    def confirmed(self) -> bool:
        """Whether the error of its joints surely falls on unseen motion."""
        return self.shown.interval[1] < 0

    @property
    def weight(self) -> float:
        """How sure the name is: the least posterior probability over its places."""
        return min(p.weight for p in self.placements)

    @property
    def sure(self) -> float:
        """How sure the name is together with those that it cannot be told from."""
        return min(p.weight + sum(r.weight for r in p.rivals if r.undecided)
                   for p in self.placements)  # fmt: skip

    def weight_of(self, family: str) -> float:
        """Return the least posterior probability of a family over the places of the effect."""
        if family == self.name:
            return self.weight
        return min(sum(r.weight for r in p.rivals if (r.family, r.place) == (family, p.place))
                   for p in self.placements)  # fmt: skip

    @property
    def joints(self) -> tuple[str, ...]:
        """Where it is."""
        return tuple(dict.fromkeys(p.place for p in self.placements))

    @property
    def p_value(self) -> float:
        """The largest over its places."""
        return max(p.p_value for p in self.placements)

    @cached_property
    def similar(self) -> dict[str, float]:
        """Largest similarity of each other family at any of its places, most similar first."""
        out: dict[str, float] = {}
        for p in self.placements:
            for r in p.rivals:
                if r.family != self.name:
                    out[r.family] = max(out.get(r.family, 0.0), r.similarity)
        return dict(sorted(out.items(), key=lambda x: -x[1]))

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Families that neither motion nor data tell from this one: the name is "A or B"."""
        rivals = [r for p in self.placements for r in p.rivals if r.family != self.name]
        return tuple(dict.fromkeys(r.family for r in rivals if r.undecided))

    @property
    def names(self) -> str:
        """The name, with its alternatives, in words."""
        return " or ".join([self.title, *map(title_of, self.alternatives)])


@frozen
class Verified:
    """What was named, and the errors before and after all of it.

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
    real_before, real_after : float
        ε_RA on unseen motion where every fit is a real robot; nan where the model has no bodies
        or keeps its values.
    """

    effects: tuple[NamedEffect, ...]
    curves: tuple[Curve, ...]
    gap: Gap
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    real_before: float
    real_after: float


@frozen(kw_only=True)
class Findings(Setting, Verified):
    """Where model and data disagree, what is missing, and what adding it does.

    Attributes
    ----------
    refuted : tuple of NamedEffect
        What the fitted motion named and unseen motion refuted, each beside what was named at the
        end; in no model.
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies, discrepancies_after : tuple of Discrepancy
    aliases : tuple of Alias
    refusals : tuple of Refusal
    steps : tuple of SearchStep
    remainder : Remainder
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

    refuted: tuple[NamedEffect, ...]
    interval: tuple[float, float]
    discrepancies: tuple[Discrepancy, ...]
    discrepancies_after: tuple[Discrepancy, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    steps: tuple[SearchStep, ...]
    remainder: Remainder
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

    @property
    def base_effects(self) -> tuple[Effect, ...]:
        """Effects of the model that was diagnosed."""
        return self.structure.model.effects
