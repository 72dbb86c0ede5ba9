"""From a hypothesis to a `Diagnosis`: values, rivals, errors on unseen motion, what is left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtrc, logsumexp

from identifiability.effects import Part, Placed
from identifiability.estimation.noise import ARNoise, runs_of, take_data, whiten
from identifiability.foundation.linalg import NEARLY, RANK_TOLERANCE
from identifiability.foundation.names import GROUPED_KINDS, INERTIAL_KINDS, Array
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares, physical_set
from identifiability.physical.project import Projection
from identifiability.regression.columns import is_body
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.diagnose.evidence import View, explain, factor_of
from identifiability.workflows.diagnose.findings import (
    SAME,
    Curve,
    NamedEffect,
    Nearest,
    Placement,
    Rival,
    Shown,
)
from identifiability.workflows.diagnose.gap import Gap, Left, Remainder, find_discrepancies
from identifiability.workflows.diagnose.hypothesis import Group, Hypothesis
from identifiability.workflows.diagnose.problem import Problem
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.search import Search, SearchStep
from identifiability.workflows.diagnose.verdict import Judged, Verdict


def conclude(search: Search, verdict: Verdict, null: Array, rng: np.random.Generator) -> Diagnosis:
    """Return the diagnosis.

    Parameters
    ----------
    search : Search
    verdict : Verdict
        What stands, and what unseen motion refuted.
    null : (T,)
        The largest log odds of anything in simulated noises.
    rng : numpy.random.Generator
    """
    verdict = replace(verdict, hypothesis=_in_order(search.problem, verdict.hypothesis))
    p, h, view = search.problem, verdict.hypothesis, verdict.view
    structure, robot = p.setting.structure, p.setting.structure.robot
    order = list(dict.fromkeys(p.candidates[k].family.name for k in h.parts))
    submodels = [
        [k for k in h.parts if p.candidates[k].family.name in order[:n]]
        for n in range(len(order) + 1)
    ]
    views = [p.settled(parts) for parts in submodels[:-1]] + [view]
    fits = [p.weighed(parts, v) for parts, v in zip(submodels, views, strict=True)]
    unseen, fitted = (
        np.stack([p.left(where, r, f[0]) for r, f in zip(submodels, fits, strict=True)], axis=2)
        for where in (p.shown, p.seen)
    )
    gap = Gap(p.shown, unseen)
    errors = gap.relative_error().tolist()
    before = Gap(p.seen, fitted).relative_error().tolist()
    real = _real_errors(p, submodels, [R for _, R in fits])
    placed = {k: _place(search, verdict, k, null) for k in h.parts}
    effects = []
    for n, name in enumerate(order):
        own = [k for k in h.parts if p.candidates[k].family.name == name]
        effects.append(
            replace(
                _effect(p, gap, own, [placed[k] for k in own], n, n + 1, verdict.judged, rng),
                real=(real[n], real[n + 1]),
                nearest=tuple(x for k in own for x in _nearest(search, h, view, k)),
            )
        )
    refuted = [_refuted(search, verdict, k, null, rng) for k in verdict.refuted]
    left, near = [fitted[:, :, n] for n in (0, -1)], p.setting.rules.near
    rms = np.sqrt(np.sum(left[1] ** 2, axis=0) / p.seen.counts)
    rest = tuple(lack_of_fit(search, h, view, j) for j in range(p.rows.joints))
    parts = []
    for name in order:
        placing = [p.candidates[k].part for k in h.parts if p.candidates[k].family.name == name]
        parts.append(Placed(placing, [_write_part(robot, part) for part in placing]))
    return Diagnosis(
        **vars(p.setting),
        effects=tuple(effects),
        curves=tuple(_curve(p, h, view, k, placed[k]) for k in h.parts),
        gap=gap,
        error_before=before[0],
        error_after=before[-1],
        held_before=errors[0],
        held_after=errors[-1],
        real_before=real[0],
        real_after=real[-1],
        refuted=tuple(refuted),
        interval=gap.interval(0, -1, rng),
        discrepancies=tuple(find_discrepancies(p.seen, left[0], robot.joints, near)),
        discrepancies_after=tuple(find_discrepancies(p.seen, left[1], robot.joints, near)),
        aliases=p.aliases,
        refusals=p.refusals,
        steps=tuple(_tell_steps(search, verdict, null, (*effects, *refuted))),
        remainder=Remainder(rms, smallest_sizes(search, h, view, rms), rest),
        model=Model((*structure.model.effects, *parts)),
    )


def _in_order(p: Problem, h: Hypothesis) -> Hypothesis:
    """Return a hypothesis with families as they came, each in the order of the robot's places."""
    robot, parts = p.setting.structure.robot, [p.candidates[k] for k in h.parts]
    came = list(dict.fromkeys(c.family.name for c in parts))
    places = {c.family.name: list(c.family.places(robot)) for c in parts}
    rank = [(came.index(c.family.name), places[c.family.name].index(c.place)) for c in parts]
    order = sorted(range(len(parts)), key=lambda k: rank[k])
    return Hypothesis(tuple(h.parts[k] for k in order), tuple(h.shaped[k] for k in order))


def null_odds(search: Search, draws: int, rng: np.random.Generator) -> Array:
    """Return the largest log odds of any name in simulated noise beside the model, (draws,).

    The memory of the noise is as uncertain as the data leave it.
    """
    p = search.problem
    view = View(p.fitted, np.zeros(p.rows.joints, int), np.ones(p.rows.joints), p.sizes)
    b, width = p.rows.X.shape[2], p.rows.D.width
    products = np.zeros((1 + b + width, draws))
    for j, noise in enumerate(p.noise.joints):
        at, runs = p.fitted.ids[j], runs_of(p.rows.moving, j)
        kept, _ = take_data(runs, p.rows.t)
        one = ARNoise((noise,)).simulate(sum(z - a for a, z in kept), draws, rng, kept)[:, 0]
        white = whiten(one, kept, noise.pacf) / noise.sigma
        columns = np.r_[: 1 + b, 1 + b + at]
        products[columns] += p.fitted.whitened(j, 0, at).T @ white
    z = view.evidence.project(products[: 1 + b], products[1 + b :])
    gains = view.evidence.gains((), p.options, p.setting.rules.alias, z)
    allowed = search.catalogue.allowed((), (), functions=False)
    most = np.full(draws, -np.inf)
    for members in search.catalogue.members.values():
        own = [k for k in members if allowed[k] and np.isfinite(gains[k, 0]) and k < p.given]
        if own:
            mean = logsumexp(gains[own], axis=0) - np.log(len(own))
            most = np.maximum(most, mean - search.catalogue.price(own[:1]))
    return most


def _p_value(odds: float, null: Array) -> float:
    return float(1 + np.count_nonzero(null >= odds)) / (1 + len(null))


def _effect(
    p: Problem,
    gap: Gap,
    own: Sequence[int],
    placements: Sequence[Placement],
    first: int,
    second: int,
    judged: dict[int, Judged],
    rng: np.random.Generator,
) -> NamedEffect:
    """Return an effect with what unseen motion shows of it where it is."""
    family = p.candidates[own[0]].family
    here = gap.at(sorted({j for k in own for j in p.acts(k)}))
    change = here.error_over_joints().tolist()
    interval = here.interval_over_joints(first, second, rng)
    odds = min(judged[k].unseen for k in own)
    shown = Shown(change[first], change[second], interval,
                  here.expected_change(first, second), odds)  # fmt: skip
    return NamedEffect(
        name=family.name,
        title=family.title,
        placements=tuple(placements),
        **gap.change(first, second, rng),
        shown=shown,
        unnamed=family.unnamed,
    )


def _refuted(
    search: Search, verdict: Verdict, k: int, null: Array, rng: np.random.Generator
) -> NamedEffect:
    """Return what unseen motion refuted, beside what stands."""
    p, h, view = search.problem, verdict.hypothesis, verdict.view
    mine = search.catalogue.of[k]
    rest = h.without({o for o in h.parts if search.catalogue.of[o] == mine})
    whole = rest.add(k, 0.0)
    seen = p.settled(whole.parts, view)
    # Without it the model is the one that stands, weighed as it was for the headline.
    fits = (p.weighed(x.parts, v)[0] for x, v in ((rest, view), (whole, seen)))
    models = [p.left(p.shown, x.parts, value) for x, value in zip((rest, whole), fits, strict=True)]
    gap = Gap(p.shown, np.stack(models, axis=2))
    judged = verdict.refuted[k]
    placement = _place(search, replace(verdict, hypothesis=whole, view=seen,
                                       judged={k: judged}), k, null)  # fmt: skip
    effect = _effect(p, gap, [k], [placement], 0, 1, {k: judged}, rng)
    return replace(effect, why=judged.why)


def _place(search: Search, verdict: Verdict, k: int, null: Array) -> Placement:
    """Return what is known of a part."""
    p, h, view = search.problem, verdict.hypothesis, verdict.view
    c, judged = p.candidates[k], verdict.judged[k]
    rest = [o for o in h.parts if o != k]
    value, covariance = p.solve([*rest, k], view)
    value, own = value[-len(c.columns) :], slice(len(value) - len(c.columns), len(value))
    error = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0) * judged.scatter)
    if is_body(c):
        # What the bounds of a body move is not known any better than without them.
        body = fit_body(p, rest, k, view)
        value, error = body, np.hypot(error, body - value)
    added = p.rows.D.take(c.columns) @ value
    robot = p.setting.structure.robot
    parameters = Placed.part_parameters(robot, c.part)
    weight, rivals = find_rivals(search, h, view, k, judged.scatter)
    alone = _determined(view.total(p.columns([*rest, k]))[1:, 1:])[own]
    return Placement(
        place=c.place,
        shape=c.shape,
        p_value=_p_value(judged.odds, null),
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=value,
        errors=error,
        rms=float(np.sqrt(np.mean(added**2, axis=0)).max()),
        rivals=tuple(rivals),
        open=tuple(x.name for x, known in zip(parameters, alone, strict=True) if not known),
        weight=weight,
        odds=judged.odds,
        scatter=judged.scatter,
        prior=p.sizes[list(c.columns)] if c.family.flexible else np.empty(0),
    )


def _determined(G: Array) -> np.ndarray:
    """Return which columns (m,) of products are determined by themselves."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(size, size)
    F = factor_of(unit)
    found: np.ndarray = np.abs(np.diag(F.T @ (F @ unit)) - 1.0) < NEARLY
    return found


def find_rivals(
    search: Search, h: Hypothesis, view: View, k: int, scatter: float
) -> tuple[float, list[Rival]]:
    """Return how likely a part is among all names for its rows, and the others, likest first.

    Their log odds are divided by the scatter of the part, as its own are. A part that another is
    right beside is right, too: what a name says beside the part is no evidence against it.
    """
    p, rules = search.problem, search.problem.setting.rules
    rest = h.without({k}).parts
    named = p.candidates[k]
    functions = named.family.unnamed
    found = _odds_of_names(search, rest, *_all_as_wide(search, rest, view), functions=functions)
    # What refines the named effect is no rival: it comes on top of it.
    found = {
        group: x for group, x in found.items()
        if group == named.group or (p.candidates[x[1]].family.needs, group[1]) != named.group
    }  # fmt: skip
    if named.group not in found:
        return 1.0, []
    beside = _odds_of_names(search, h.parts, view, 0.0, functions=functions)
    value, best = {}, {}
    for group, (odds, at) in found.items():
        other = beside[group][0] if group != named.group and group in beside else -np.inf
        value[group] = odds - float(np.logaddexp(0.0, other))
        best[group] = k if group == named.group else at
    level = np.array(list(value.values())) / scatter
    weights = dict(zip(value, np.exp(level - logsumexp(level)).tolist(), strict=True))
    order = sorted(weights, key=lambda g: -weights[g])
    total, sure = 0.0, set()
    for group in order:
        sure.add(group)
        total += weights[group]
        if total >= 1.0 - rules.level:
            break
    rivals = []
    for group in order:
        if group == named.group:
            continue
        similarity, contains = _similarity(p, view, rest, k, best[group])
        if similarity > 0.0:
            rivals.append(Rival(*group, similarity, group in sure, contains, weights[group]))
    return weights[named.group], sorted(rivals, key=lambda r: -r.similarity)


def _all_as_wide(search: Search, rest: Sequence[int], view: View) -> tuple[View, Array]:
    """Return a view in which each name's prior is as wide as it must be, and what that costs.

    The view of a hypothesis has the priors of its own parts as wide as these are: beside rivals
    with narrow ones a part would be likelier for being there.
    """
    p, at = search.problem, search.problem.columns(rest)
    sizes = p.sizes.copy()
    sizes[at] = view.typical[at]
    wide = replace(view, sizes=sizes).evidence.beside(at).widths(p.options)
    for c, width in zip(p.candidates, wide.tolist(), strict=True):
        if width > 1.0 and not {*c.columns} & {*at}:
            sizes[list(c.columns)] *= width
    return replace(view, sizes=sizes), np.log(wide)


def _odds_of_names(
    search: Search, rest: Sequence[int], view: View, wide: Array | float, *, functions: bool
) -> dict[Group, tuple[float, int]]:
    """Return the log odds of each name beside some parts, and its best candidate.

    What unseen motion refuted is none; what only was not sure beside others may be right alone.
    """
    p = search.problem
    allowed = search.catalogue.allowed(rest, search.refuted, functions=functions)
    gains, cost = search.gains(rest, view) - wide, search.catalogue.further(rest)
    found: dict[Group, list[int]] = {}
    for o in np.flatnonzero(allowed & np.isfinite(gains)).tolist():
        found.setdefault(p.candidates[o].group, []).append(o)
    out = {}
    for group, own in found.items():
        grid = [o for o in own if o < p.given]
        mean = logsumexp(gains[grid]) - np.log(len(grid)) if grid else -np.inf
        at = max(own, key=lambda o: gains[o])
        mean = max(float(mean), float(gains[at]) - float(np.log(max(len(grid), 1))))
        out[group] = mean - float(cost[at]), at
    return out


def _similarity(
    p: Problem, view: View, rest: Sequence[int], one: int, other: int
) -> tuple[float, bool]:
    """Return the largest canonical correlation of two parts, and whether the other has the one."""
    a, b = (list(p.candidates[k].columns) for k in (one, other))
    at, evidence = [*a, *b], view.evidence
    P = np.array([evidence.row(k)[at] for k in at])
    beside = p.columns(rest)
    if beside:
        R = np.array([evidence.row(k) for k in beside])
        F = factor_of(R[:, beside])
        C = F @ R[:, at]
        P = P - C.T @ C
    n = len(a)
    first, second = factor_of(P[:n, :n]), factor_of(P[n:, n:])
    shared = np.linalg.svd(first @ P[:n, n:] @ second.T, compute_uv=False)
    if not len(shared):
        return 0.0, False
    contains = len(first) < len(second) and float(shared[len(first) - 1]) > SAME
    return min(float(shared[0]), 1.0), contains


def _nearest(search: Search, h: Hypothesis, view: View, k: int) -> list[Nearest]:
    """Return the names at the place of a function that explain most in its stead."""
    p = search.problem
    own = p.candidates[k]
    if not own.family.unnamed:
        return []
    rest = h.without({k})

    def error_with(parts: Sequence[int]) -> float:
        left = p.left(p.shown, parts, p.weighed(parts, view)[0])[:, :, None]
        return float(Gap(p.shown, left).at(p.acts(k)).error_over_joints()[0])

    # Names that are said beside a function.
    near = sorted(
        (x for x in search.options(rest.parts, view, functions=False).values()
         if p.candidates[x[1]].place == own.place),
        reverse=True,
    )[:3]  # fmt: skip
    whole = error_with(h.parts) or 1.0
    return [
        Nearest(p.candidates[o].family.title, error_with([*rest.parts, o]) / whole - 1.0)
        for _, o, _ in near
    ]


def _curve(p: Problem, h: Hypothesis, view: View, k: int, placed: Placement) -> Curve:
    """Return what a part was learned to be, along the fitted motion."""
    c, rows = p.candidates[k], p.seen
    left, D = p.residual(rows, h.parts, view), rows.D.take(c.columns)
    robot, added = p.setting.structure.robot, D @ placed.values
    j = int(np.argmax(np.abs(added).sum(0)))
    of = c.family.drawn_over(c.effect, robot, j)
    law = D[:, j]
    if c.family.against in ("velocity", "position") and not (c.family.remembers or robot.closed):
        # As it is, not as the low-pass leaves it, which depends on where the motion came from.
        law = np.zeros_like(D)
        motion = complete_motion(robot, rows.t, rows.q, rows.dq, rows.ddq)
        Placed([c.part]).fill(robot, motion, law)
        law = law[:, j]
    return Curve(
        title=c.family.title,
        joint=j,
        of=of,
        against=c.family.against,
        x=rows.along(of)[c.family.against],
        learned=law @ placed.values,
        spread=np.sqrt(law**2 @ placed.errors**2),
        data=left[:, j] + added[:, j],
    )


def _tell_steps(
    search: Search, verdict: Verdict, null: Array, effects: Sequence[NamedEffect]
) -> list[SearchStep]:
    """Return the steps of the search with what became of each."""
    p = search.problem
    named = {p.candidates[k].group: verdict.judged[k] for k in verdict.hypothesis.parts}
    gone = {p.candidates[k].group: verdict.refuted[k] for k in verdict.refuted}
    taken_out = (k for group in search.barred for k in search.catalogue.members.get(group, ()))
    unsure = {p.candidates[k].group for k in taken_out} - gone.keys()
    out = []
    for s in search.steps:
        odds = s.evidence.get(s.best, -np.inf)
        shown = next((e.shown for e in effects if e.name == s.best[0]), None)
        known = shown is not None and s.best in {**gone, **named} and shown.before > 0
        gain = 1.0 - shown.after / shown.before if shown and known else float("nan")
        reason = "named" if s.best in named else ""
        if s.best in gone and s.best not in named:
            reason = gone[s.best].why
        elif not reason:
            weak = odds < s.critical or s.best in unsure
            reason = "it is not sure enough" if weak else "another effect explains what it does"
        out.append(replace(s, p_value=_p_value(odds, null), gain=gain,
                           accepted=s.best in named, reason=reason))  # fmt: skip
    return out


def lack_of_fit(search: Search, h: Hypothesis, view: View, j: int) -> Left | None:
    """Return what functions without a name still explain in a joint, beside all that was named."""
    p = search.problem
    joint = p.setting.structure.robot.joints[j]
    kinds = [
        c for c in p.candidates
        if c.family.unnamed and c.place == joint and p.sizes[list(c.columns)].any()
    ]  # fmt: skip
    if not kinds:
        return None
    e = p.errors(p.fitted, h.parts, view)[j]
    whole = float(e @ e) / float(view.tempered[j])
    beside = p.columns(h.parts)
    evidence = view.evidence
    R = np.array([evidence.row(k) for k in beside]).reshape(len(beside), len(p.sizes))
    F = factor_of(R[:, beside])
    least, most = 1.0, 0.0
    for c in kinds:
        at = list(c.columns)
        C = F @ R[:, at]
        P = evidence.among(np.array([at]))[0] - C.T @ C
        z = evidence.z[at] - C.T @ (F @ evidence.z[beside])
        square, directions = explain(P, z, evidence.own[at], p.setting.rules.alias)
        least = min(least, float(chdtrc(max(directions, 1), max(square, 0.0))))
        most = max(most, square - directions)
    share = float(np.clip(most / whole, 0.0, 1.0)) if whole > 0 else 0.0
    return Left(share, min(1.0, len(kinds) * least))


def smallest_sizes(search: Search, h: Hypothesis, view: View, rms: Array) -> dict[str, float]:
    """Return the smallest effect of each family that is named in four of five logs like these.

    As a share of the residual (rms) at the place where it is seen best.
    """
    p, evidence = search.problem, view.evidence
    taken = {p.candidates[k].group for k in h.parts}
    out: dict[str, float] = {}
    odds = p.setting.rules.odds
    size = p.rows.D.rms()
    for number, c in enumerate(p.candidates[: p.given]):
        if c.group in taken or c.family.unnamed:
            continue
        for k in c.columns:
            information, j = float(evidence.left[k]), int(np.argmax(size[:, k]))
            if not (information > RANK_TOLERANCE * evidence.own[k] > 0) or not rms[j] > 0:
                continue
            needed = odds + search.catalogue.price([number]) + 0.5 * np.log1p(information)
            # Quantile of the normal distribution for a power of 80 %.
            reach = np.sqrt(2 * needed * (1 + 1 / information)) + 0.8416
            share = float(reach / np.sqrt(information) * p.sizes[k] * size[j, k] / rms[j])
            out[c.family.name] = min(out.get(c.family.name, np.inf), share)
    return out


def fit_body(p: Problem, rest: Sequence[int], k: int, view: View) -> Array:
    """Return the values (10,) of the body nearest to the data that can exist.

    Least squares alone may give a negative mass.
    """
    R = p.triangular([*rest, k], view)
    own = p.candidates[k].columns
    first = len(R) - 1 - len(own)
    R, n = R[first:, first:], len(own)
    data = LeastSquares(R[:n, :n], R[:n, n], float(R[n, n] ** 2), float(len(p.rows)))
    region = PhysicalSet(
        bodies=np.array([[INERTIAL_KINDS.index(kind) for kind in GROUPED_KINDS]]),
        nonnegative=np.zeros(n, bool),
        names=(p.candidates[k].place,),
        columns=tuple(INERTIAL_KINDS),
    )
    found: Array = Projection(region, reference=np.zeros(n)).solve(data).phi
    return found


def _real_errors(
    p: Problem, submodels: Sequence[Sequence[int]], factors: Sequence[Array]
) -> list[float]:
    """Return ε_RA on unseen motion where every fit is a real robot; nan where none is to be had."""
    structure = p.setting.structure
    if p.setting.fixed or "rigid_body" not in structure.model.names:
        return [float("nan")] * len(submodels)
    out = []
    b, near = len(structure.G), p.setting.near
    for parts, R in zip(submodels, factors, strict=True):
        signs = [p.candidates[k].positive for k in parts for _ in p.candidates[k].columns]
        start = np.zeros(len(R) - 1)
        start[:b] = 0.0 if near is None else near.values
        whole = np.column_stack([R[:, :-1], R[:, -1] + R[:, :-1] @ start])
        value = fit_real(structure, whole, signs, len(p.rows))
        if value is None:
            out.append(float("nan"))
            continue
        value = value - start
        left = p.left(p.shown, parts, value)
        out.append(float(Gap(p.shown, left[:, :, None]).relative_error()[0]))
    return out


def _write_part(robot: Robot, part: Part) -> str:
    """Return an effect at its place, with its shape, as a model file writes it."""
    name = part.effect.name
    shape = part.effect.shapes(robot).get(f"{part.owner}.{name}")
    return f"{name}@{part.owner}" if shape is None else f"{name}@{part.owner}:{float(shape)!r}"


def fit_real(structure: Structure, R: Array, positive: Sequence[bool], rows: int) -> Array | None:
    """Return the values (b + m,) of the real robot nearest to the data; None if there is none.

    Parameters
    ----------
    structure : Structure
        Of the b base parameters.
    R : (b + m + 1, b + m + 1)
        Triangular factor of columns and torque, in units of the noise.
    positive : sequence of bool, (m,)
        Of which further columns the sign is known.
    rows : int
    """
    region = physical_set(structure)
    if not len(region.bodies):
        return None
    m, b = len(R) - 1, len(structure.G)
    G = block_diag(structure.G, np.eye(m - b))
    region = replace(
        region,
        nonnegative=np.concatenate([region.nonnegative, np.array(positive, bool)]),
        columns=(*region.columns, *(f"effect {k + 1}" for k in range(m - b))),
    )
    data = LeastSquares(R[:m, :m] @ G, R[:m, m], float(R[m, m] ** 2), float(max(rows - m, 1)))
    reference = np.concatenate([structure.nominal, np.zeros(m - b)])
    try:
        value: Array = G @ Projection(region, reference=reference).solve(data).phi
    except ValueError:
        return None
    return value
