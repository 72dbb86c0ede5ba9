"""A diagnosis in sentences."""

from __future__ import annotations

import numpy as np

from identifiability.effects import find_family, title_of
from identifiability.foundation.names import BASE
from identifiability.foundation.numbers import REACH, percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.workflows.answers import state_joints
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Refuted
from identifiability.workflows.diagnose.motion import Change, join

#: Effects that the headline states in full, and names and places that it lists of each.
FULL, LISTED = 2, 3
#: An error below this share of the torque is rounding.
ROUNDING: Tolerance = 1e-9
#: What a residual looks like that depends on one of these; a function of any other.
LOOKS = {
    "time": "a drift over time",
    "session": "a drift over the session",
    "log": "a difference between the logs",
    "load": "something that goes with the load",
}
#: Weight above which none is said.
MOST: Tolerance = 0.99


@frozen
class Remark:
    """A sentence beside the answer; `good` when it supports it."""

    title: str
    text: str
    good: bool = False


def state(d: Findings) -> str:
    """Return the answer in plain words, and below it a list of what should be known with it."""
    error = d.held_after if d.effects else d.held_before
    each = state_joints(d.robot.joints, d.gap.joint_error()[:, -1], error)
    first = " ".join(filter(None, (d.mass_warning, headline(d), each)))
    return "\n- ".join([first, *(r.text for r in remarks(d)), state_remainder(d)])


def headline(d: Findings) -> str:
    """Return the model, what changed, what is missing, how far the gap shrinks, what is open."""
    model = d.alternative.partition(":")[0]
    first = [f"{model}."] if model else []
    return " ".join([*first, *map(state_change, d.changes), _state_named(d)])


def state_change(c: Change) -> str:
    """Return what changed in the middle of a log: when, what, and what became of it."""
    what = _first_of(c.names)
    value, error, unit = c.values[0], c.errors[0], c.units[0]
    size = f"{value:.3g} ± {REACH * error:.2g} {unit}".replace("-", "−")
    if c.parameters[0] in c.open:
        size = "of a size that this motion leaves open"
    elif c.family == "payload":
        what, size = f"a mass of {size} on {c.place}" + what.removeprefix(c.names[0]), ""
    sure = ", ".join(filter(None, (size, f"weight {weight_text(c.weight)}")))
    return (
        f"{_capital(c.when)} another robot was logged. The difference: {what} ({sure}). What was "
        "logged meanwhile was left out."
    )


def _state_named(d: Findings) -> str:
    """Return what is missing, how far the gap shrinks and what is open, in three sentences."""
    start = "the robot file's own values" if d.fixed else "the refitted model"
    start = start if d.known is None else d.known.words
    if not d.effects:
        why = "No effect can be named" if d.evidence else _state_untried(d)
        return (
            f"{why}: {start} predict{'' if d.fixed else 's'} unseen motion "
            f"({d.verified_on}) with an error of {percent(d.held_before)}."
        )
    verb = "falls" if d.held_after < d.held_before else "goes"
    change = (
        f"On {d.verified_on}, which was not fitted, the error {verb} "
        f"{_change(d.held_before, d.held_after, d.interval)}."
    )
    return " ".join([f"{_state_missing(d)}.", change, *_state_undecided(d)])


def _state_missing(d: Findings) -> str:
    """Return what is missing in one sentence; of many effects the names and where they are."""
    if len(d.effects) <= FULL:
        return _capital("; ".join(_state_effect(e) for e in d.effects))
    named = [e.title if e.joints == ("base",) else f"{e.title} ({_where(e)})" for e in d.effects]
    return f"{len(d.effects)} effects are missing: {join(named)}"


def _at(name: str, place: str) -> str:
    """Return an effect and where it is; of the base its title says it."""
    return title_of(name) if place == BASE else f"{title_of(name)} in {place}"


def _where(e: NamedEffect) -> str:
    """Return where an effect is, in words."""
    if e.everywhere:
        return "all joints"
    return join(e.joints) if len(e.joints) <= LISTED else f"{len(e.joints)} joints"


def _state_undecided(d: Findings) -> list[str]:
    """Return a sentence on names that cannot be told apart, if there are any."""
    open_names = [e for e in d.effects if e.alternatives]
    if len(d.effects) <= FULL and len(open_names) == 1:
        return [_state_rivals(open_names[0])]
    if not open_names:
        return []
    return [
        f"This motion cannot tell {join([e.title for e in open_names])} from other names, which "
        "are listed with what would."
    ]


def _state_untried(d: Findings) -> str:
    """Return why no family was tried, and the beginning of the sentence after that."""
    if d.nothing:
        return f"Nothing is named, because {d.nothing}. As it is"
    reasons: dict[str, list[str]] = {}
    for r in d.refusals:
        reasons.setdefault(r.reason, []).append(f"{r.family} {r.place}".strip())
    for a in d.aliases:
        lies = f"these logs cannot tell it from {join(a.behind[:3])}"
        reasons.setdefault(lies, []).append(f"{a.family} {a.place}".strip())
    why = "; ".join(f"{join(names)} ({reason})" for reason, names in reasons.items())
    return f"Nothing was left to name: {why}. Give other families, or none for all. As it is"


def remarks(d: Findings) -> list[Remark]:
    """Return what else should be known of the named effects, and what was refuted."""
    always = [Remark("Refuted", _state_refuted(x, d)) for x in d.refuted]
    always += [Remark("Please note", hint) for hint in d.hints]
    if not d.effects:
        return always
    out = []
    if d.forward is not None and d.forward.measured:
        better = d.forward.interval[1] < 0
        out.append(Remark("In simulated motion", d.forward.statement, better))
    named = [Remark("Named", f"{_capital(_state_effect(e))}.") for e in d.effects]
    rivals = [Remark("A or B", _state_rivals(e)) for e in d.effects if e.alternatives]
    if len(d.effects) <= FULL:  # the headline has them
        named, rivals = [], rivals if len(rivals) > 1 else []
    return [*named, *rivals, *out, *(r for e in d.effects for r in _caveats(e)), *always]


def _state_effect(e: NamedEffect) -> str:
    where = "" if e.joints == ("base",) else f" in {_where(e)}"
    sure = f" (log odds {e.odds:.3g})" if np.isfinite(e.odds) else ""
    return f"{_either(e)}{where}{_state_mass(e)}{sure}"


def weight_text(weight: float) -> str:
    """Return a weight in words: none is said nearer to one than noise and priors are known."""
    return f"> {MOST}" if weight > MOST else f"{weight:.2f}"


def _either(e: NamedEffect) -> str:
    """Return the name with its alternatives, the first ones of many."""
    return _first_of([e.title, *map(title_of, e.alternatives)])


def _first_of(names: list[str]) -> str:
    more = len(names) - LISTED
    return " or ".join(names if more < 2 else [*names[:LISTED], f"{more} others"])


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]


def _state_mass(e: NamedEffect) -> str:
    """Return the mass of what was named, where it has one, with its 95 % interval."""
    masses = []
    for p in e.placements:
        for name, value, error, unit in p.rows:
            if name.endswith(".payload_m"):
                told = f"{value:.3g} ± {REACH * error:.2g} {unit}"
                masses.append("of a mass that this motion leaves open" if name in p.open else told)
    return f", {' and '.join(masses)}".replace("-", "−") if masses else ""


def _state_refuted(x: Refuted, d: Findings) -> str:
    """Return that the motion that verifies did not confirm an effect."""
    what = _capital(_at(x.name, x.place))
    gain = f"{x.unseen:.2g}".replace("-", "−")
    return (
        f"{what} stood out from the fitted motion (log odds {x.odds:.3g}) and is left out: on "
        f"{d.verified_on} the torque is not surely likelier with it (log likelihood ratio {gain}), "
        "or its error is larger."
    )


def _state_rivals(e: NamedEffect) -> str:
    return f"This motion cannot tell {e.names} apart: {advice(e)}."


def _caveats(e: NamedEffect) -> list[Remark]:
    title, out = _capital(e.title), []
    if e.unnamed:
        near = join(list(e.nearest))
        text = f"Nearest to it are {near}." if near else "No effect that has a name can be there."
        out.append(
            Remark("Without a name", f"No name explains this in {_where(e)} as well. {text}")
        )
    if not e.confirmed:
        text = (
            f"{title} by itself does not surely lower the error of its joints there, each on its "
            "own scale: treat it with caution."
        )
        out.append(Remark("Not confirmed", text))
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
    r = d.remainder
    if max(d.held_after, d.error_after) < ROUNDING:
        return "The residual is rounding: the logs are explained to their last digits."
    parts = []
    if r.detectable:
        name, size = min(r.detectable.items(), key=lambda x: x[1])
        parts.append(
            f"The smallest nameable effect here is {name.replace('_', ' ')} of "
            f"{percent(size, 2)} of the residual"
        )
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
    if best < d.rules.visible:
        return "noise: it depends on none of velocity, position, acceleration, load or time"
    kind = LOOKS.get(where, f"a function of {where}")
    return f"{kind} in {most.joint} ({percent(best, 2)} of its variance)"
