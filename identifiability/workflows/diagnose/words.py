"""A diagnosis in sentences."""

from __future__ import annotations

import numpy as np

from identifiability.effects import find_family, title_of
from identifiability.foundation.answers import Note
from identifiability.foundation.names import BASE
from identifiability.foundation.numbers import REACH, percent
from identifiability.foundation.rounding import join
from identifiability.foundation.rules import Tolerance
from identifiability.workflows.answers import state_joints
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Refuted

#: Effects that the headline states, and names and places that it lists of each.
FULL, LISTED = 4, 3
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
    each = state_joints(d.robot.joints, d.gap.joint_error()[:, -1], error)
    first = " ".join(filter(None, (d.mass_warning, headline(d), each)))
    return "\n- ".join([first, *(r.text for r in remarks(d)), state_remainder(d)])


def headline(d: Findings) -> str:
    """Return what changed, what is missing and how far the gap shrinks."""
    return " ".join([*(c.statement for c in d.changes), _state_named(d)])


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
    told, more = [_state_effect(e) for e in d.effects[:FULL]], len(d.effects) - FULL
    told += [f"and {more} more, which are listed"] * (more > 0)
    return f"{_capital('; '.join(told))}. {change}"


def _at(name: str, place: str) -> str:
    """Return an effect and where it is; of the base its title says it."""
    return title_of(name) if place == BASE else f"{title_of(name)} in {place}"


def _where(e: NamedEffect) -> str:
    """Return where an effect is, in words."""
    return "all joints" if e.everywhere else join(e.joints, LISTED)


def _state_untried(d: Findings) -> str:
    """Return why no family was tried, and the beginning of the sentence after that."""
    if d.nothing:
        return f"Nothing is named, because {d.nothing}. As it is"
    why = {f"{r.family} ({r.reason})": 0 for r in d.refusals}
    why |= {f"{a.family} (looks like {join(a.behind)} in these logs)": 0 for a in d.aliases}
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
    at = "" if e.leaning is None else f": gravity {e.leaning.text}"
    sure = f" (log odds {e.odds:.3g})" if np.isfinite(e.odds) else ""
    return f"{e.called}{where}{_state_mass(e)}{at}{sure}"


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
