"""`Findings`: where model and data disagree, and what is missing."""

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property

from identifiability.effects import Effect, title_of
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import state_mass
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.gates import Nearest, Step, Survival
from identifiability.workflows.diagnose.lookalikes import Alias, Rival
from identifiability.workflows.diagnose.material import Setting
from identifiability.workflows.diagnose.residual import Discrepancy, Remainder
from identifiability.workflows.diagnose.rows import Refusal
from identifiability.workflows.diagnose.shown import UNASKED, Both, Shown
from identifiability.workflows.diagnose.turns import Turn
from identifiability.workflows.gravity import Leaning


@frozen
class Placement:
    """A named effect at one place.

    Attributes
    ----------
    place : str
    shape : float
        nan for families without one.
    p_value : float
        Family-wise, at the step that named it; of what is in doubt that of both motions.
    parameters, units : tuple of str
    values, errors : (k,)
        Generalised least squares, with standard errors.
    rms : float [N·m or N]
        Of the torque that it adds at the joint where it is largest.
    rivals : tuple of Rival
    stress : tuple of Survival
    open : tuple of str
        Parameters that the motion determines together with others only: their values are the
        smallest of many.
    strength : float
        Its size in standard errors of that.
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
    stress: tuple[Survival, ...]
    open: tuple[str, ...] = ()
    strength: float = float("inf")

    @property
    def rows(self) -> list[tuple[str, float, float, str]]:
        """Name, value, standard error and unit of each parameter."""
        values, errors = self.values.tolist(), self.errors.tolist()
        return list(zip(self.parameters, values, errors, self.units, strict=True))

    @property
    def fragile(self) -> tuple[str, ...]:
        """Variations of the motion that the effect does not survive."""
        return tuple(s.variation for s in self.stress if not s.survived)


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
        Motion, torque of the effect, its standard error, and the residual without the effect.
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
    unnamed, rare : bool
        Whether it has no name; whether it has none or is of a family of the second pass.
    nearest : tuple of Nearest
        Names that were refused in its stead.
    both : Both
        What fitted and unseen motion say of it beside all else that was named.
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
    rare: bool = False
    nearest: tuple[Nearest, ...] = ()
    both: Both = UNASKED
    leaning: Leaning | None = None

    @property
    def confirmed(self) -> bool:
        """Whether the motion that verifies surely has less error with it, where it is or in all."""
        worse = self.joints_interval[0] > 0 or self.shown.interval[0] > 0
        return not worse and (self.joints_interval[1] < 0 or self.shown.better)

    @property
    def refuted(self) -> bool:
        """Whether the motion that verifies contradicts it.

        It surely has more error with it, or what is shown where it is contradicts it, unless the
        effect is surely there beside noise so slow that the error rises with it; or noise makes the
        like too often, or nothing there speaks for it. What is in doubt must be likely, alike and
        beside noise; what is rare be confirmed by motion that can; a function by any, or be likely.
        """
        if self.doubted and not (self.both.within_noise and self.both.likely and self.shown.alike):
            return True
        if self.confirmed or self.both.unlikely or self.both.opposes(self.shown):
            return not self.confirmed
        likely = self.both.likely and self.shown.after <= self.shown.before
        needed = not likely if self.unnamed else self.rare and self.shown.telling
        against = self.joints_interval[0] > 0 or self.shown.contradicts
        return needed or (against and not self.shown.there)

    @property
    def doubted(self) -> bool:
        """Whether the fitted motion alone would not have given it: then it takes both motions."""
        return not self.unnamed and self.both.p_value > self.both.level

    @property
    def joints(self) -> tuple[str, ...]:
        """Where it is."""
        return tuple(dict.fromkeys(p.place for p in self.placements))

    @property
    def p_value(self) -> float:
        """The largest over its places; of both motions where the fitted one leaves it in doubt."""
        if self.doubted:
            return min(self.both.chance, 1.0)
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
        What the fitted motion named and the motion that verifies surely contradicts, each beside
        what was named then; in no model.
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies, discrepancies_after : tuple of Discrepancy
    aliases : tuple of Alias
    refusals : tuple of Refusal
    steps : tuple of Step
    remainder : Remainder
    model : Model
        The base model with the named effects.
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    earlier : str
        The diagnosis that was gone on from; empty for none.
    earlier_error : float
        Its ε_RA on unseen motion, with what it named.
    turns : tuple of Turn
        What became of each of its names.
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
    steps: tuple[Step, ...]
    remainder: Remainder
    model: Model
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    earlier: str = ""
    earlier_error: float = float("nan")
    turns: tuple[Turn, ...] = ()
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
