"""A diagnosis in sentences."""

from __future__ import annotations

import numpy as np

from identifiability.effects import find_family, title_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.numbers import REACH, holm, percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.workflows.answers import state_joints
from identifiability.workflows.diagnose.findings import SAME, Findings, NamedEffect
from identifiability.workflows.diagnose.motion import OTHER, Change, join
from identifiability.workflows.diagnose.verdict import REFUTED, WORSE

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
#: From which on three digits would.
NEARER_ONE: Tolerance = 0.9995
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
    """Return what changed, what is missing, how far the gap shrinks and what is open."""
    return " ".join([*map(state_change, d.changes), _state_named(d)])


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
        why = "No effect can be named" if d.steps else _state_untried(d)
        return (
            f"{why}: {start} predict{'' if d.fixed else 's'} unseen motion "
            f"({d.verified_on}) with an error of {percent(d.held_before)}.{_state_refused(d)}"
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
    named = []
    for e in d.effects:
        at = join(e.joints) if len(e.joints) <= LISTED else f"{len(e.joints)} joints"
        named.append(e.title if e.joints == ("base",) else f"{e.title} ({at})")
    worst = max(e.p_value for e in d.effects)
    return f"{len(d.effects)} effects are missing (p ≤ {worst:.2g}): {join(named)}"


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


def _state_refused(d: Findings) -> str:
    """Return what stood out from the noise and was refused all the same."""
    known = [e.name for e in d.refuted]
    for s in d.steps:
        if s.p_value <= d.rules.level and not s.accepted and s.best[0] not in known:
            name, place = s.best
            return (
                f" {name.replace('_', ' ').capitalize()} in {place} stands out from the noise (p ≤ "
                f"{s.p_value:.2g}) but is refused: {s.reason}."
            )
    return ""


def remarks(d: Findings) -> list[Remark]:
    """Return what else should be known of the named effects, and what was refuted."""
    always = [Remark("Refuted", _state_contradicted(e, d)) for e in d.refuted]
    always += [Remark("Please note", hint) for hint in d.hints]
    if not d.effects:
        return always
    out = []
    if np.isfinite(d.real_after):
        change = _change(d.real_before, d.real_after)
        text = f"With bodies that can exist the error goes {change}."
        out.append(Remark("A real robot", text, d.real_after < d.real_before))
    if d.forward is not None and d.forward.measured:
        better = d.forward.interval[1] < 0
        out.append(Remark("In simulated motion", d.forward.statement, better))
    named = [Remark("Named", f"{_capital(_state_effect(e))}.") for e in d.effects]
    rivals = [Remark("A or B", _state_rivals(e)) for e in d.effects if e.alternatives]
    if len(d.effects) <= FULL:  # the headline has them
        named, rivals = [], rivals if len(rivals) > 1 else []
    return [
        *named,
        *rivals,
        *out,
        *(r for e in d.effects for r in _caveats(e, d.rules.similar)),
        *always,
    ]


def _state_effect(e: NamedEffect) -> str:
    where = "" if e.joints == ("base",) else f" in {join(e.joints)}"
    at = "" if e.leaning is None else f": gravity {e.leaning.text}"
    sure = "" if e.why else f"weight {weight_text(e.sure)}, "
    return f"{_either(e)}{where}{_state_mass(e)}{at} ({sure}p ≤ {e.p_value:.2g})"


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


def contradiction(e: NamedEffect, odds: float) -> str:
    """Return what unseen motion says of an effect that it does not let stand, to follow its name.

    Log odds between those for and those against it leave it open; and what serves its own joints,
    but makes the error over all of them surely larger, is not refuted where it is.

    Parameters
    ----------
    e : NamedEffect
    odds : float [nat]
        From which on a name is stated.
    """
    if e.why == OTHER:
        return f"its value is refuted ({OTHER})"
    if e.why == WORSE and e.shown.odds > 0 and e.shown.after <= e.shown.before:
        return "is left out"
    return "is not confirmed" if e.why == REFUTED and abs(e.shown.odds) < odds else "is refuted"


def _state_contradicted(e: NamedEffect, d: Findings) -> str:
    """Return what the motion that verifies says against an effect."""
    named, what, verified_on = (
        _capital(_state_effect(e)),
        contradiction(e, d.rules.odds),
        d.verified_on,
    )
    start = f"{named} stood out from the fitted motion and {what}: on {verified_on}"
    if np.isnan(e.shown.before):  # without a scale of its own there is no error over it
        return f"{start} the torque where it is never changes."
    change = _change(e.shown.before, e.shown.after, e.shown.interval)
    likelier = "likelier" if e.shown.odds > 0 else "less likely"
    odds = f"{e.shown.odds:.2g}".replace("-", "−")
    over_all = ""
    if e.why == WORSE:
        risen = _change(e.joints_before, e.joints_after, e.joints_interval)
        over_all = f" Over all joints it goes {risen}."
    return (
        f"{start} the torque is {likelier} with it (log likelihood ratio {odds}), and the error of "
        f"its joints, each on its own scale, goes {change}.{over_all}"
    )


def _state_rivals(e: NamedEffect) -> str:
    weights = [weight_text(e.weight_of(name)) for name in (e.name, *e.alternatives)]
    return (
        f"This motion cannot tell {e.names} apart (weights {join(weights)}, similarity "
        f"{_similarity(max(e.similar[a] for a in e.alternatives))}): {advice(e)}."
    )


def _state_nearest(e: NamedEffect) -> str:
    """Return the names nearest to a function without one, and why they were refused."""
    more = [(n.title, percent(abs(n.worse), 2), n.worse < 0) for n in e.nearest]
    near = join([f"{title} ({by} {'less' if less else 'more'})" for title, by, less in more])
    if not near:
        return "No effect that has a name can be there."
    function = f"{e.title.removeprefix('an unnamed ')} in {join(e.joints)}"
    return (
        f"No name explains this {function} as well; with the nearest instead of it the error of "
        f"its joints on unseen motion is another: {near}."
    )


def _caveats(e: NamedEffect, similar: float) -> list[Remark]:
    title, out = e.title[0].upper() + e.title[1:], []
    if e.unnamed:
        out.append(Remark("Without a name", _state_nearest(e)))
    name, similarity = next(iter(e.similar.items()), ("", 0.0))  # the most similar
    if similarity > similar and not (e.alternatives or e.unnamed):
        out.append(Remark("Resembles", _state_resembling(e, name, similarity)))
    if not e.confirmed:
        text = (
            f"{title} by itself does not surely lower the error of its joints there, each on its "
            "own scale: treat it with caution."
        )
        out.append(Remark("Not confirmed", text))
    return out


def _state_resembling(e: NamedEffect, name: str, similarity: float) -> str:
    """Return what the most similar name is to an effect that the data do tell from it."""
    title, other = _capital(e.title), title_of(name)
    if all(any(r.family == name and r.contains for r in p.rivals) for p in e.placements):
        return (
            f"Whatever {e.title} is in this motion, {other} can be too, so no data prefer the "
            "former: it has the name because it says as much with less."
        )
    if similarity > SAME:
        return f"{_capital(other)} is a part of {e.title} in this motion, and explains less alone."
    return (
        f"{title} resembles {other} in this motion (similarity {_similarity(similarity)}); the "
        "data prefer the former."
    )


def _similarity(x: float) -> str:
    """Return a similarity with two digits after the point, more where these would say one."""
    # Similarity from which on two digits after the point would say that it is one.
    return f"{x:.2f}" if not 0.995 <= x <= SAME else f"{min(x, 0.9999):.{3 + (x >= NEARER_ONE)}f}"


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
    parts += [_functions(d), f"The residual looks like {_looks(d)}"]
    return " ".join(f"{part}." for part in parts)


def _functions(d: Findings) -> str:
    """Return whether functions without a name still explain something, in words."""
    asked = {
        joint: left
        for joint, left in zip(d.robot.joints, d.remainder.joints, strict=True)
        if left is not None
    }
    if not asked:
        return (
            "The motion that names effects is too short to say whether the rest depends on motion "
            "and load: record more of it"
        )
    corrected = holm(np.array([left.p_value for left in asked.values()]))
    seen = [
        f"{percent(left.share, 2)} of the residual in {joint}"
        for (joint, left), p in zip(asked.items(), corrected, strict=True)
        if p < ESTIMATION_RULES.unasked_level
    ]
    if seen:
        return f"Functions of motion and load without a name would explain {join(seen)}"
    where = "any joint" if len(asked) == len(d.robot.joints) else join(list(asked))
    return f"Functions of motion and load without a name explain nothing more in {where}"


def _looks(d: Findings) -> str:
    """Return what the residual depends on most, in words."""
    most = max(d.discrepancies_after, key=lambda x: max(x.explained.values(), default=0.0))
    where, best = max(most.explained.items(), key=lambda x: x[1])
    if best < d.rules.visible:
        return "noise: it depends on none of velocity, position, acceleration, load or time"
    kind = LOOKS.get(where, f"a function of {where}")
    return f"{kind} in {most.joint} ({percent(best, 2)} of its variance)"
