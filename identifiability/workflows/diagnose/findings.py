"""`Findings`: where model and data disagree, and what is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from identifiability.effects import find_family, title_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.answers import Note
from identifiability.foundation.names import BASE, Array
from identifiability.foundation.numbers import REACH, percent
from identifiability.foundation.rounding import join
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.cad_prior import state_mass
from identifiability.regression.columns import Refusal
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.answers import state_joints
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.problem import Discrepancy, Gap, Setting

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
class Odds:
    """Log odds of a family at a place, or in all joints.

    Attributes
    ----------
    name, place : str
    before, after : float [nat]
        Beside the model, and beside what was named as well; nan of what was named itself.
    unseen : float [nat]
        What it gains on unseen motion; nan where it was not asked.
    """

    name: str
    place: str
    before: float
    after: float = float("nan")
    unseen: float = float("nan")


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
    refuted : tuple of Odds
        Of what fitted motion named and unseen motion did not confirm; in no model.
    interval : (float, float)
        95 % of the change on unseen motion.
    discrepancies : tuple of Discrepancy
        Where what is left of the fitted motion sits.
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
    alternative : str
        Under which other reading of the logs it was diagnosed, in a sentence; empty for none.
    """

    effects: tuple[NamedEffect, ...]
    curves: tuple[Curve, ...]
    gap: Gap
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    refuted: tuple[Odds, ...]
    interval: tuple[float, float]
    discrepancies: tuple[Discrepancy, ...]
    refusals: tuple[Refusal, ...]
    evidence: tuple[Odds, ...]
    values: Array
    model: Model
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    nothing: str = ""
    alternative: str = ""
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
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        known = None if self.forward is None else self.forward.nearest
        return "" if known is None else state_mass(self.robot, known.values, known.cad_weight)


#: What became of rows of another robot.
LEFT_OUT = "What was logged meanwhile was left out."
#: Places that the headline lists of each effect.
PLACES = 3
#: An error below this share of the torque is rounding.
ROUNDING: Tolerance = 1e-9
#: Share of its variance from which on what a residual depends on is said.
VISIBLE: Tolerance = 0.05
#: What a residual looks like that depends on one of these; a function of any other.
LOOKS = {
    "time": "a drift over time",
    "session": "a drift over the session",
    "log": "a difference between the logs",
    "load": "something that goes with the load",
}


def state(d: Findings) -> str:
    """Return the answer in plain words, and below it a list of what should be known with it."""
    error = d.held_after if d.effects else d.held_before
    each = state_joints(d.robot.joints, d.gap.prediction.joint_error()[:, -1], error)
    first = " ".join(filter(None, (d.mass_warning, headline(d), each)))
    return "\n- ".join([first, *(r.text for r in remarks(d)), state_remainder(d)])


def headline(d: Findings) -> str:
    """Return the model, what changed, what is missing and how far the gap shrinks."""
    model = d.alternative.partition(":")[0]
    first = [f"{model}."] if model else []
    changed = [f"{_capital(c.called)}. {LEFT_OUT}" for c in d.changes]
    return " ".join([*first, *changed, _state_named(d)])


def _state_named(d: Findings) -> str:
    """Return what is missing and how far the gap shrinks."""
    if not d.effects:
        why = "No effect can be named" if d.evidence else _state_untried(d)
        return (
            f"{why}: {d.known.words} predict{'' if d.fixed else 's'} unseen motion "
            f"({d.verified_on}) with an error of {percent(d.held_before)}."
        )
    change = (
        f"On {d.verified_on}, which was not fitted, the error goes "
        f"{_change(d.held_before, d.held_after, d.interval)}."
    )
    return f"{_capital('; '.join(map(_state_effect, d.effects)))}. {change}"


def _at(name: str, place: str) -> str:
    """Return an effect and where it is; of the base its title says it."""
    return title_of(name) if place == BASE else f"{title_of(name)} in {place}"


def _where(e: NamedEffect) -> str:
    """Return where an effect is, in words."""
    return "all joints" if e.everywhere else join(e.joints, PLACES)


def _state_untried(d: Findings) -> str:
    """Return why no family was tried, and the beginning of the sentence after that."""
    if d.nothing:
        return f"Nothing is named, because {d.nothing}. As it is"
    why = {f"{r.family} ({r.reason})": 0 for r in d.refusals}
    text = join(list(why))
    return f"Nothing was left to name: {text}. Give other families, or none for all. As it is"


def remarks(d: Findings) -> list[Note]:
    """Return what else should be known of the named effects, and what was refuted."""
    out = []
    if d.forward is not None and d.forward.measured:
        better = d.forward.interval[1] < 0
        out.append(Note("good" if better else "note", "In simulated motion", d.forward.statement))
    for e in d.effects:
        out += [Note("note", "A or B", _state_rivals(e))] if e.alternatives else []
        out += _caveats(e)
    out += [Note("note", "Refuted", _state_refuted(x, d)) for x in d.refuted]
    return out + [Note("note", "Please note", hint) for hint in d.hints]


def _state_effect(e: NamedEffect) -> str:
    where = "" if e.joints == ("base",) else f" in {_where(e)}"
    sure = f" (log odds {e.odds:.3g})" if np.isfinite(e.odds) else ""
    return f"{e.called}{where}{_state_mass(e)}{sure}"


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _state_mass(e: NamedEffect) -> str:
    """Return the mass of what was named, where it has one, with its 95 % interval."""
    masses = []
    for p in e.placements:
        for name, value, error, unit in p.rows:
            if name.endswith(".payload_m"):
                masses.append(f"{value:.3g} ± {REACH * error:.2g} {unit}")
    return f", {' and '.join(masses)}".replace("-", "−") if masses else ""


def _state_refuted(x: Odds, d: Findings) -> str:
    """Return that the motion that verifies did not confirm an effect."""
    what = _capital(_at(x.name, x.place))
    gain = f"{x.unseen:.2g}".replace("-", "−")
    return (
        f"{what} stood out from the fitted motion (log odds {x.before:.3g}) and is left out: on "
        f"{d.verified_on} the torque is not surely likelier with it (log likelihood ratio {gain}), "
        "or its error is larger."
    )


def _state_rivals(e: NamedEffect) -> str:
    return f"This motion cannot tell {' or '.join(e.names)} apart: {advice(e)}."


def _caveats(e: NamedEffect) -> list[Note]:
    out = []
    if e.unnamed:
        near = join(e.nearest)
        text = f"Nearest to it are {near}." if near else "No effect that has a name can be there."
        out.append(
            Note("note", "Without a name", f"No name explains this in {_where(e)} as well. {text}")
        )
    if not e.confirmed:
        text = f"Unseen motion alone does not say so of {e.title}: treat it with caution."
        out.append(Note("note", "Not confirmed", text))
    return out


def advice(e: NamedEffect) -> str:
    """Return the motion that would tell an effect from its alternatives."""
    motions = [find_family(name).told_by for name in (e.name, *e.alternatives)]
    known = join(list(dict.fromkeys(filter(None, motions))))
    return f"{known or 'run other speeds, postures and loads in turn'} to separate them"


def _change(before: float, after: float, interval: tuple[float, ...] = ()) -> str:
    """Return how an error changes, with the 95 % interval of that."""
    text = f"from {percent(before)} to {percent(after)}"
    ends = [f"{100 * x:+.2g}".replace("-", "−") for x in interval]
    return f"{text} (95 %: {' … '.join(ends)} points)" if ends else text


def state_remainder(d: Findings) -> str:
    """Return what is left in words."""
    if max(d.held_after, d.error_after) < ROUNDING:
        return "The residual is rounding: the logs are explained to their last digits."
    parts = []
    left = [x for x in d.evidence if np.isfinite(x.after)]
    if left:
        most = max(left, key=lambda x: x.after)
        odds = f"{most.after:.2g}".replace("-", "−")
        parts.append(
            "Nothing that is known explains the rest; the likeliest is "
            f"{_at(most.name, most.place)} (log odds {odds})"
        )
    parts.append(f"The residual looks like {_looks(d)}")
    return " ".join(f"{part}." for part in parts)


def _looks(d: Findings) -> str:
    """Return what the residual depends on most, in words."""
    most = max(d.discrepancies, key=lambda x: max(x.explained.values(), default=0.0))
    where, best = max(most.explained.items(), key=lambda x: x[1])
    if best < VISIBLE:
        return "noise: it depends on none of velocity, position, acceleration, load or time"
    kind = LOOKS.get(where, f"a function of {where}")
    return f"{kind} in {most.joint} ({percent(best, 2)} of its variance)"
