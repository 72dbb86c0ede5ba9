"""What the next motion is asked: which names to tell apart, or which hidden effects to show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from identifiability.effects import Part, Placed, find_family
from identifiability.effects.effect import measure_spans
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.workflows.diagnose.decision_chance import aim_at, decision_chance
from identifiability.workflows.diagnose.findings import Findings, Placement
from identifiability.workflows.diagnose.rows import list_candidates
from identifiability.workflows.excite.criteria import (
    Known,
    Question,
    Reveal,
    Separation,
    pose_question,
)
from identifiability.workflows.excite.limits import Limits
from identifiability.workflows.excite.search import Objective, Series

#: Similarity from which on two effects are the same torque, and another motion changes nothing.
SAME = 1.0 - 1e-6
#: Random motions that are asked whether any motion tells effects apart, and samples of each.
LOOKS, SAMPLES = 12, 150
#: Score that an effect must reach where no step was made that says so.
CRITICAL = 8.0


@frozen
class Asked:
    """A question to the next motion.

    Attributes
    ----------
    question : Question
        With its criterion.
    names : tuple of str
        What is to be told apart or shown, as a model file writes it.
    known : (k, k)
        What the logs say of its columns, weighted.
    weights : (n,)
        What a sample of each joint says.
    chance : callable((k, k)) -> float
        The chance that it is decided with such information.
    hidden, same : bool
        As in `NextMotion`.
    """

    question: Question
    names: tuple[str, ...]
    known: Array
    weights: Array
    chance: Callable[[Array], float]
    hidden: bool
    same: bool


def ask_open(d: Findings, series: Series, seed: int) -> Asked | None:
    """Return the question about the undecided name with the largest torque; None without one.

    Rivals that no motion tells from it are left out, unless there are no others.
    """
    found = [
        (p.rms, e.name, p)
        for e in d.effects
        for p in e.placements
        if any(r.undecided and r.family != e.name for r in p.rivals)
    ]
    if not found:
        return None
    _, name, placement = max(found, key=lambda one: one[:2])
    rivals = [r for r in placement.rivals if r.undecided and r.family != name]
    (named, shapes), *others = (
        place_all(d, family, place, series.limits)
        for family, place in (
            (name, placement.place),
            *dict.fromkeys((r.family, r.place) for r in rivals),
        )
    )
    left = [text for text in d.model.texts if text != _text(name, placement)]
    parts = [part for other, _ in others for part in other.parts]
    every = Placed(parts, [text for other, _ in others for text in other.texts])
    question = pose_question(d.robot, "separate", Model.of(*left), None, (named, every))
    aim, weights = question.criterion, _weigh(d)
    assert isinstance(aim, Separation)
    known = _gram(question, d, weights)
    own = _split(d, named, aim.first)
    columns, k = [], 0
    for other, _ in others:
        count = len(other.parameters(d.robot))
        columns.append(_split(d, other, aim.second[k : k + count]))
        k += count
    at = _find_part(d, placement, named, shapes)
    whole = aim_at(known, own, columns, at, placement.values)
    grams = _look_about(replace(question, criterion=whole), series, weights, seed)
    asks = [
        ask
        for ask in whole.asks
        if len(grams) and replace(whole, asks=(ask,)).similarity(grams).min() < SAME
    ]
    told = {k for k in range(len(others)) if all(a in asks for a in whole.asks if a.rival == k)}
    same = not told
    aim = whole if same else replace(whole, asks=tuple(a for a in whole.asks if a.rival in told))
    texts = [other.texts[0] for k, (other, _) in enumerate(others) if same or k in told]
    return Asked(
        question=replace(question, criterion=aim),
        names=(_text(name, placement), *texts),
        known=known,
        weights=weights,
        chance=lambda G: decision_chance(aim, G, d.rules.confusable),
        hidden=False,
        same=same,
    )


def ask_hidden(d: Findings, series: Series, seed: int) -> Asked | None:
    """Return the question about what the model says as well along these logs; None if nothing is.

    Each effect is as large as what is left where it acts. Those that no motion shows are left out.
    """
    groups = dict.fromkeys((a.family, a.place) for a in d.aliases if a.structural)
    named = {(e.name, place) for e in d.effects for place in e.joints}
    placed = [
        _place_one(d, family, place)
        for family, place in groups
        if (family, place) not in named and not find_family(family).unnamed
    ]
    if not placed:
        return None
    parts = [p for other in placed for p in other.parts]
    question = pose_question(d.robot, "separate", d.model, None, (Placed(parts), Placed(parts[:1])))
    question, weights = _without_second(question), _weigh(d)
    assert isinstance(question.criterion, Separation)
    ends = np.cumsum([len(p.parameters(d.robot)) for p in placed])
    columns = np.split(question.criterion.first, ends[:-1])
    known = _gram(question, d, weights)
    sizes = _sizes(question, d, columns)
    aim = Reveal(tuple(columns), tuple(sizes))
    grams = _look_about(replace(question, criterion=aim), series, weights, seed)
    if not len(grams):
        return None
    length = np.array([
        np.einsum("mij,i,j->m", G, x, x) for G, x in (
            (grams[:, own][:, :, own], size) for own, size in zip(columns, sizes, strict=True)
        )
    ])  # fmt: skip
    shown = (aim.squares(grams) > d.rules.alias**2 * np.maximum(length, 1e-300)).any(1)
    if not shown.any():
        return None
    aim = Reveal(
        tuple(c for c, s in zip(columns, shown, strict=True) if s),
        tuple(x for x, s in zip(sizes, shown, strict=True) if s),
    )
    critical = d.steps[-1].critical if d.steps else CRITICAL
    reach = float(stats.norm.isf(np.exp(-critical)))

    def chance(G: Array) -> float:
        return float(np.mean(stats.norm.sf(reach - np.sqrt(aim.squares(G[None])[:, 0]))))

    names = tuple(p.texts[0] for p, s in zip(placed, shown, strict=True) if s)
    return Asked(
        replace(question, criterion=aim), names, known, weights, chance, hidden=True, same=False
    )


def _without_second(question: Question) -> Question:
    """Return a question about two effects without the columns of the second."""
    aim = question.criterion
    assert isinstance(aim, Separation)
    end = len(question.columns) - len(aim.second)
    last = question.model.effects[:-1]
    return replace(
        question,
        model=Model(last),
        columns=question.columns[:end],
        names=question.names[:end],
        units=question.units[:end],
    )


def _look_about(question: Question, series: Series, weights: Array, seed: int) -> Array:
    """Return what random motions by themselves say of the columns of a question, (m, k, k)."""
    k = len(question.columns)
    known = Known(np.zeros((k, k)), weights, float(SAMPLES))
    objective = Objective(question, known, series, SAMPLES)
    G, space = objective.look(series.draw(LOOKS, np.random.default_rng(seed)), SAMPLES)
    usable: Array = G[space.open == 0]
    return usable


def _sizes(question: Question, d: Findings, columns: Sequence[np.ndarray]) -> list[Array]:
    """Return values (p,) of effects whose torque is as large as what is left where they act."""
    regression = Regression(d.robot, question.model, d.samples, question.columns)
    W = np.concatenate([c.W for part in regression.parts() for c in part.chunks()])
    rms, out = np.sqrt(np.mean(W**2, axis=0)), []
    for own in columns:
        j = int(np.argmax(rms[:, own].sum(1)))
        size = np.maximum(rms[j, own], 1e-12 * max(float(rms[j].max()), 1e-300))
        out.append(d.remainder.rms[j] / size / np.sqrt(len(own)))
    return out


def _place_one(d: Findings, name: str, place: str) -> Placed:
    """Return a family at a place, with the shape in the middle of those that are tried."""
    motions, family = [s.motion for s in d.samples], find_family(name)
    listed, _ = list_candidates(d.robot, [family], d.structure.present, motions, fixed=d.fixed)
    own = [c for c in listed if c.place == place]
    c = own[len(own) // 2]
    return Placed([c.part], [f"{name}@{place}"])


def _text(name: str, placement: Placement) -> str:
    """Return what was named at a place, as a model file writes it."""
    place, shape = placement.place, placement.shape
    return f"{name}@{place}" if np.isnan(shape) else f"{name}@{place}:{float(shape)!r}"


def place_all(d: Findings, name: str, place: str, limits: Limits) -> tuple[Placed, list[float]]:
    """Return a family at a place with all of its shapes, those of a wider motion too."""
    motions, family = [s.motion for s in d.samples], find_family(name)
    listed, _ = list_candidates(d.robot, [family], d.structure.present, motions, fixed=d.fixed)
    listed = [c for c in listed if c.place == place]
    kinds = list(dict.fromkeys(c.kinds for c in listed))
    span = measure_spans(d.robot, motions).get(place)
    shapes: tuple[float, ...] = (float("nan"),)
    if span is not None:
        shapes = family.grid(span)
        if place in limits.joints and family.shapes is not None:
            j = limits.joints.index(place)
            speed = max(float(limits.speed[j]), span.largest_speed)
            wider = replace(
                span,
                position_range=float(limits.high[j] - limits.low[j]),
                rms_speed=max(speed / 2, span.rms_speed),
                largest_speed=speed,
            )
            shapes = tuple(dict.fromkeys((*shapes, *family.grid(wider))))
        if family.continuous:
            shapes = halve_steps(shapes)
    every = [(shape, own) for shape in shapes for own in kinds]
    if family.flexible:  # which parameters there are hangs on the shape
        every = [(c.shape, c.kinds) for c in listed]
    parts = [Part(family.at(shape, place), place, own) for shape, own in every]
    return Placed(parts, [f"{name}@{place}"]), [shape for shape, _ in every]


def halve_steps(shapes: Sequence[float]) -> tuple[float, ...]:
    """Return shapes of the same range, neighbours half as far apart as the first two are.

    What only the truth explains would else be what lies between two shapes of its rival.
    """
    low, high = min(shapes), max(shapes)
    steps = 2 * np.log(high / low) / np.log(shapes[1] / shapes[0])
    return tuple(np.geomspace(low, high, 1 + round(steps)).tolist())


def _find_part(d: Findings, placement: Placement, effect: Placed, shapes: list[float]) -> int:
    """Return which part of an effect with all of its shapes was found."""
    own = [
        tuple(p.name for p in Placed.part_parameters(d.robot, part)) == placement.parameters
        for part in effect.parts
    ]
    away = np.abs(np.nan_to_num(np.array(shapes) - placement.shape))
    return int(np.argmin(np.where(own, away, np.inf)))


def _weigh(d: Findings) -> Array:
    """Return the information that a sample of each joint has, (n,) [1/(N·m)² or 1/N²]."""
    memory = np.array([found.memory for found in d.discrepancies_after])
    rms = np.maximum(d.remainder.rms, 1e-12 * float(d.remainder.rms.max()) or 1.0)
    weights: Array = 1.0 / (rms**2 * np.maximum(memory, 1.0))
    return weights


def _gram(question: Question, d: Findings, weights: Array) -> Array:
    """Return what the fitted logs say of the columns of a question, (k, k)."""
    regression = Regression(d.robot, question.model, d.samples, question.columns)
    k = len(question.columns)
    R = gather_information(regression).factor(weights)[:k, :k]
    gram: Array = R.T @ R
    return gram


def _split(d: Findings, effect: Placed, columns: np.ndarray) -> list[np.ndarray]:
    """Return the columns of each part of an effect."""
    widths = [len(Placed.part_parameters(d.robot, part)) for part in effect.parts]
    return np.split(columns, np.cumsum(widths)[:-1])
