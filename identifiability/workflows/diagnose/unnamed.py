"""What no name explains: its shape is learned, and said to have no name.

A third pass, beside what was named: smooth functions of velocity, load, time, another joint's
velocity, or of two of these with the position, at a stricter level and by the same gates. A name
that such a function makes needless, or beside which one at its place surely explains more, did
not fit. Functions are named where nothing else is, so they must be confirmed by the motion that
verifies, or likely by both motions together, not only not refuted.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from identifiability.effects import find_families
from identifiability.workflows.diagnose.evidence import score_candidates
from identifiability.workflows.diagnose.gates import Chosen, Naming, Nearest, keep_surviving
from identifiability.workflows.diagnose.late import SESSION, gain_over, is_curve, what_is_left
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import DRAWS, Material
from identifiability.workflows.diagnose.name_curves import CURVE, name_curves
from identifiability.workflows.diagnose.naming import Say, name_effects
from identifiability.workflows.diagnose.options import find_same, signature
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.whole import together

#: Steps of the search, and names that are said beside a function.
MOST, NEAREST = 4, 3
#: Share of the level of names at which functions are searched.
SHARE = 0.2


def name_unnamed(
    material: Material,
    naming: Naming,
    rng: np.random.Generator,
    effects: Iterable[str] | None = None,
    draws: int = DRAWS,
    say: Say | None = None,
    told: Sequence[tuple[str, str]] = (),
) -> tuple[Material, Naming]:
    """Return what is named once functions without a name may be, else what was named.

    Parameters
    ----------
    material, naming : Material, Naming
        Of the passes before.
    rng : numpy.random.Generator
    effects, draws
        As for `gather`.
    say : callable, optional
    told : sequence of (family, place)
        Functions that an earlier diagnosis gave: the search begins with them.
    """
    asked = [f for f in find_families(effects) if f.unnamed]
    curves = several_curves(naming.chosen)
    if not (told or curves or (causes := what_is_left(material, naming)) - {SESSION}):
        asked = [f for f in asked if causes and f.against == SESSION]
    functions = list(dict.fromkeys([*(f.name for f in asked), *(name for name, _ in told)]))
    if not functions:
        return material, naming
    setting = material.setting
    named = list(dict.fromkeys(c.family.name for c in naming.chosen))
    wider = material.anew(rng, [*named, *functions], draws)
    rules = replace(
        setting.rules, level=max(SHARE * setting.rules.level, 1.0 / (draws + 1)), most=MOST
    )
    present = setting.structure.present
    found: tuple[float, Naming] | None = None
    before = naming.chosen
    without = tuple(c for c in before if c not in curves)
    early = tuple(c for c in before if not c.family.late)
    own = [find_same(c, wider.candidates) for c in before]
    fits = keep_fitting(wider, own, rules.level)
    fitting = tuple(c for c, same in zip(before, own, strict=True) if same in fits)
    for known in dict.fromkeys((before, early, without, fitting)):
        start = [find_same(c, wider.candidates) for c in known]
        start += _begin(wider, start, told)
        taken = signature(start)
        options = [c for c in wider.candidates if c.family.unnamed or c.slot in taken]
        again = name_effects(wider.bench, options, wider.held, rules, present, say, start)
        lost = [c for c in known if c.slot not in signature(again.chosen)]
        parts = list_parts(lost, again.chosen)
        if not any(c.family.unnamed for c in again.chosen):
            continue
        # A function that stands in for what every joint has says nothing new.
        if any(c.family.basic for c in lost if c not in parts) or says_again(fitting, again.chosen):
            continue
        gain = gain_over(material.held, naming, wider.held, again)
        # Beside a name that does not fit a function need not predict better, only not surely
        # worse; in its stead, or with it as a part, it must, if not surely; in that of names that
        # nothing spoke against, surely.
        least = -gain.error if lost else max(setting.rules.gain, gain.error)
        if known != before:
            least = max(least, 0.0) if known == early != without else -gain.error
        if known == fitting != before or parts:
            least = 0.0
        if known == without != before:
            several = [same for c, same in zip(before, own, strict=True) if c in curves]
            least = least if decide_for(wider, several, again.chosen) else -np.inf
        if gain.share > max(least, -np.inf if found is None else found[0]):
            found = gain.share, again
    if found is None:
        return material, naming
    again = found[1]
    whole, chosen, p_values = name_curves(material, again, wider)
    groups = {c.group for c in chosen}
    gone = [c for c in naming.chosen if c.group not in groups]
    left = keep_surviving(naming, gone, present, "a function without a name explains it better")
    final = Naming(
        chosen=chosen,
        p_values={**p_values, **naming.p_values},
        steps=(*left.steps, *again.steps),
        nearest={c.group: _nearest(whole, chosen, c) for c in chosen if c.family.unnamed},
        replaced=tuple(find_same(c, whole.candidates) for c in gone),
    )
    return whole, final


def several_curves(named: Sequence[Candidate]) -> Chosen:
    """Return what refines the friction of a joint by its speed where several names do.

    What is two functions of one speed is rather one without an equation; so is what is two of one
    position, a spring and an offset among them, where the dictionary has no name for both.
    """
    own = [c for c in named if c.family.needs and c.family.against == "velocity"]
    own = [c for c in own if not (c.family.late or c.family.origin)]
    several: Chosen = []
    for kind in (own, [c for c in named if is_curve(c)]):
        places = [c.place for c in kind]
        several += [c for c in kind if places.count(c.place) > 1]
    return several


def decide_for(m: Material, several: Sequence[Candidate], chosen: Sequence[Candidate]) -> bool:
    """Whether the data decide for several names over the functions in their joints.

    These have more columns, for which likelihoods compared by their tails let them pay. So would
    predictions, for noise is fitted by them: a true function predicts a little worse than two laws
    that happen to make it up.
    """
    places = {c.place for c in several}
    functions = [c for c in chosen if c.family.unnamed and c.place in places]
    if not functions:
        return True
    model = m.white.basis([c for c in chosen if c not in functions])
    both = [together(several), together(functions)]
    names, one = score_candidates(m.white, model, both, null=False).fit
    return bool(names > one + DECISIVE)


def says_again(fitting: Sequence[Candidate], chosen: Sequence[Candidate]) -> bool:
    """Whether a function is in the stead of a name of its joint that fits and says the same.

    That is a curve of the position, and a drift: whatever fits them better by chance is a function
    of position or time.
    """
    functions = [c for c in chosen if c.family.unnamed]
    here = {(f.place, "position") for f in functions if f.family.name == CURVE}
    here |= {(f.place, "time") for f in functions if f.family.against == "time"}
    names = [c for c in fitting if c.family.flexible or c.family.against == "time"]
    lost = [c for c in names if c.slot not in signature(chosen)]
    return any((c.place, c.family.against) in here for c in lost)


def list_parts(lost: Sequence[Candidate], chosen: Sequence[Candidate]) -> Chosen:
    """Return names that a function at their place contains: what it says as well.

    The function stood out beside such a name, as more than it: an offset beside a spring is that
    spring with another rest. Nothing that every joint has is denied by that.
    """
    whole = {
        (name, f.place) for f in chosen if f.family.unnamed for name in f.family.effect.supersedes
    }
    return [c for c in lost if c.group in whole]


def keep_fitting(m: Material, named: Sequence[Candidate], level: float) -> tuple[Candidate, ...]:
    """Return names without those in whose joint a function surely explains what they leave.

    A true law leaves nothing: the test of its lack of fit [Fisher 1922], against the functions at
    its place alone. Among those of all joints it would have to stand out from noise elsewhere.
    Places share the level [Bonferroni].
    """
    white, doubted = m.bench.whiten(m.bench.misfit(m.held.fitted_residual(named))), set()
    places = {c.place for c in named if not c.family.basic}
    for place in places:
        options = [c for c in m.candidates if c.family.unnamed and c.place == place]
        if options:
            scores = score_candidates(white, white.basis(named), options)
            highest, top = scores.null.max(0), scores.data.max()
            if 1 + np.count_nonzero(highest >= top) <= level / len(places) * (1 + len(highest)):
                doubted.add(place)
    return tuple(c for c in named if c.family.basic or c.place not in doubted)


def _begin(
    m: Material, beside: Sequence[Candidate], told: Sequence[tuple[str, str]]
) -> list[Candidate]:
    """Return functions that were given before, each of the shape that explains most."""
    model, out = m.white.basis(beside), []
    for group in told:
        options = [c for c in m.candidates if c.group == group]
        if options:
            fit = score_candidates(m.white, model, options, null=False).fit
            out.append(options[int(fit.argmax())])
    return out


def _nearest(m: Material, chosen: Sequence[Candidate], function: Candidate) -> tuple[Nearest, ...]:
    """Return the names at the place of a function that explain most in its stead."""
    rest: Chosen = [c for c in chosen if c is not function]
    taken = {c.group for c in rest}
    options = [
        c
        for c in m.candidates
        if c.place == function.place and not c.family.unnamed and c.group not in taken
    ]
    if not options:
        return ()
    fit = score_candidates(m.white, m.white.basis(rest), options, null=False).fit
    best: dict[str, Candidate] = {}
    for k in np.argsort(-fit).tolist():
        best.setdefault(options[k].family.name, options[k])
    with_it = m.held.error([*rest, function])
    return tuple(
        Nearest(c.family.title, m.held.error([*rest, c]) / with_it - 1.0)
        for c in islice(best.values(), NEAREST)
    )
