"""Springs, curves, memory and drifts: asked for where all else has said what it can.

They are many columns, and whatever is smooth looks a little like them. So they are searched in a
second pass, with noise that is fitted beside them, and only where something is left to say: the
first pass named an effect of the position, or what it leaves depends on one of what they depend
on. Its level is that of the first; what it names must surely predict better, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from identifiability.effects import Family, find_families
from identifiability.workflows.diagnose.gates import Chosen, Naming
from identifiability.workflows.diagnose.held_out import Gain, HeldOut, gain_of
from identifiability.workflows.diagnose.material import DRAWS, Material
from identifiability.workflows.diagnose.naming import Say, name_effects
from identifiability.workflows.diagnose.options import find_same
from identifiability.workflows.diagnose.residual import find_discrepancies
from identifiability.workflows.diagnose.rows import Candidate

#: Share of a joint's residual by one of these from which on there is something to ask for.
NOTABLE = 0.03
CAUSES = ("position", "velocity", "load", "time")
#: What is left that depends on this alone asks for functions of it alone: no name is of it.
SESSION = "session"
#: What is sure to be left, of which it is not said what it depends on.
ANYTHING = "anything"
#: What one spring is, where both are named in one joint.
SPRING, PARTS = "free_spring", ("joint_stiffness", "torque_offset")


def early(families: Sequence[Family]) -> tuple[Family, ...]:
    """Return the families of the first pass: all but the late ones, unless there are no others."""
    named = [f for f in families if not f.unnamed]
    return tuple(f for f in named if not f.late) or tuple(named)


def name_late(
    material: Material,
    naming: Naming,
    rng: np.random.Generator,
    effects: Iterable[str] | None = None,
    draws: int = DRAWS,
    say: Say | None = None,
    refused: Sequence[Candidate] = (),
) -> tuple[Material, Naming]:
    """Return what is named once late families may be, else what was named.

    Parameters
    ----------
    material, naming : Material, Naming
        Of the first pass.
    rng : numpy.random.Generator
    effects, draws
        As for `gather`.
    say : callable, optional
    refused : sequence of Candidate
        Names that left more than they explain: in their joints what resembles the missing effect
        would be named first again, for it has fewer columns. It may come back beside a late one.
    """
    families = [f for f in find_families(effects) if not f.unnamed]
    first = early(families)
    alone = len(first) == len(families)
    if alone:
        return material, _settle_knots(material.held, naming, material.candidates)
    if not _asks(material, naming):
        return material, naming
    wider = material.anew(rng, [f.name for f in (*first, *_late(families))], draws)
    rules = material.setting.rules
    present = material.setting.structure.present
    start = [find_same(c, wider.candidates) for c in naming.chosen]
    doubtful, taken = {c.place for c in refused}, {c.group for c in start}
    options = [
        c for c in wider.candidates if c.family.late or c.place not in doubtful or c.group in taken
    ]
    again = name_effects(wider.bench, options, wider.held, rules, present, say, start)
    if refused and any(c.family.late for c in again.chosen):
        every, start = wider.candidates, list(again.chosen)
        again = again.then(name_effects(wider.bench, every, wider.held, rules, present, say, start))
    again = _gather_curves(
        wider.held, merge_springs(again, wider.candidates), wider.candidates, rules.gain
    )
    again = _settle_knots(wider.held, again, wider.candidates)
    if naming.p_values:
        least = max(naming.p_values.values())  # of what has another name now
        p_values = {c.group: naming.p_values.get(c.group, least) for c in again.chosen}
        again = replace(again, p_values={**p_values, **again.p_values})
    named = any(c.family.late for c in again.chosen)
    if named and predicts_better(material.held, naming, wider.held, again, rules.gain):
        return wider, again
    # No late name is given, but each may be another name for what is: its rival. Where fewer names
    # say it, beside noise that is fitted beside all families, it is these.
    if not named and len(again.chosen) < len(naming.chosen):
        return wider, again
    start = [find_same(c, wider.candidates) for c in naming.chosen]
    return wider, merge_springs(replace(naming, chosen=tuple(start)), wider.candidates)


def _late(families: Sequence[Family]) -> tuple[Family, ...]:
    return tuple(f for f in families if f.late)


def _asks(material: Material, naming: Naming) -> bool:
    """Whether an effect of a position was named, or what is left depends on anything."""
    curved = any(is_curve(c) for c in naming.chosen)
    return curved or bool(what_is_left(material, naming) - {SESSION})


def what_is_left(material: Material, naming: Naming) -> frozenset[str]:
    """Return what the residual of any joint depends on beside what was named.

    Two criteria, for neither sees what the other does: both only say whether a search is worth its
    time, whose own level says what is there. A share of the residual finds one dependence, however
    weak the evidence; what `Remains` finds surely is spread over a hundred functions, of which one
    effect is little. Of sixty late effects half as large as the noise, on four short logs, a search
    that only `Remains` could ask for left eighteen without their name, and of twenty robots without
    effects neither named any. On long logs dependences below the share are certain, and `Remains`
    asks.
    """
    left = material.held.fitted_residual(naming.chosen)
    joints = material.setting.structure.robot.joints
    found = find_discrepancies(material.train, left, joints)
    shares = [(cause, d.explained.get(cause, 0.0)) for d in found for cause in (*CAUSES, SESSION)]
    causes = {cause for cause, share in shares if share > NOTABLE}
    if causes <= {SESSION} and material.remains(naming.chosen).anything:
        causes.add(ANYTHING)
    return frozenset(causes)


def predicts_better(
    held: HeldOut, naming: Naming, wider: HeldOut, again: Naming, least: float
) -> bool:
    """Whether the second naming surely predicts better than what it keeps, as real robots.

    What takes the place of a name must also predict better than that, if not surely: it is there
    because it stands out beside the name, and the name beside it does not.
    """
    groups = {c.group for c in again.chosen}
    rest = replace(naming, chosen=tuple(c for c in naming.chosen if c.group in groups))
    gain = gain_over(held, rest, wider, again)
    return gain.share > max(least, gain.error) and gain_over(held, naming, wider, again).share > 0


def gain_over(held: HeldOut, naming: Naming, wider: HeldOut, again: Naming) -> Gain:
    """Return what a second naming gains over the first on the motion that chooses."""
    before, after = held.errors(naming.chosen, real=True), wider.errors(again.chosen, real=True)
    return gain_of(before, after)


def merge_springs(naming: Naming, candidates: Sequence[Candidate]) -> Naming:
    """Return a naming in which stiffness and offset of one joint are one spring: the same torque.

    The columns are the same, and so is every prediction; the name is one.
    """
    chosen, p_values = list(naming.chosen), dict(naming.p_values)
    for spring in (c for c in candidates if c.family.name == SPRING):
        parts = [c for c in chosen if c.group in {(name, spring.place) for name in PARTS}]
        if {c.family.name for c in parts} == set(PARTS):
            chosen = [spring if c is parts[0] else c for c in chosen if c is not parts[1]]
            p_values[spring.group] = max(p_values.get(c.group, np.nan) for c in parts)
    if len(chosen) == len(naming.chosen):
        return naming
    return replace(naming, chosen=tuple(chosen), p_values=p_values)


def _gather_curves(
    held: HeldOut, naming: Naming, candidates: Sequence[Candidate], least: float
) -> Naming:
    """Return a naming with one curve in a joint unless several of its kind surely predict better.

    What is three functions of one position is rather one without an equation.
    """
    chosen, p_values = list(naming.chosen), dict(naming.p_values)
    for place in dict.fromkeys(c.place for c in naming.chosen):
        parts = [c for c in chosen if c.place == place and is_curve(c)]
        curves = [c for c in candidates if c.place == place and c.family.flexible and is_curve(c)]
        if len(parts) < 2 or not curves:
            continue
        rest = [c for c in chosen if c not in parts]
        trial = min(([*rest, c] for c in curves), key=held.error)
        gain = held.gain(trial, chosen)  # of several over the one
        if gain.share <= max(least, gain.error):
            p_values[trial[-1].group] = max(p_values.get(c.group, np.nan) for c in parts)
            chosen = trial
    if chosen == list(naming.chosen):
        return naming
    return replace(naming, chosen=tuple(chosen), p_values=p_values)


def is_curve(c: Candidate) -> bool:
    """Whether a candidate is torque by the position alone."""
    alone = c.family.against == "position" and not c.family.dry
    return alone or c.family.name in PARTS


def _settle_knots(held: HeldOut, naming: Naming, candidates: Sequence[Candidate]) -> Naming:
    """Return a naming whose curves have as many pieces as predict best what was not fitted."""
    chosen: Chosen = list(naming.chosen)
    for at, own in enumerate(naming.chosen):
        if own.family.flexible:
            rest = [*chosen[:at], *chosen[at + 1 :]]
            others = [[*rest, c] for c in candidates if c.group == own.group]
            chosen[at] = min(others, key=held.error)[-1]
    return replace(naming, chosen=tuple(chosen))
