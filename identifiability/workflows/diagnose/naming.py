"""`Naming`: effects that a model lacks, found and confirmed by one mixed model.

Groups of all families at all places, and everywhere, are searched on fitted rows; unseen rows may
only remove them. The remaining groups become parts of a model, at the places where they are sure.
Each has one shape, which is refined between the shapes of the grid.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain, zip_longest

import numpy as np
from scipy.special import logsumexp, softmax

from identifiability.effects import Part as EffectPart
from identifiability.effects import Placed, find_families
from identifiability.effects.effect import EXPONENT
from identifiability.effects.friction import REVERSALS
from identifiability.effects.functions import FunctionOfVelocity
from identifiability.estimation.estimate import Outliers, with_known
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import LEVELS, Evidence
from identifiability.estimation.gaussian import Normal
from identifiability.estimation.groups import Excerpt, Missing, with_reversals
from identifiability.estimation.mixed_model import EVERYWHERE, MixedModel, Term, Terms
from identifiability.estimation.noise import split_runs
from identifiability.estimation.prediction import Prediction, predict
from identifiability.estimation.rules import RULES
from identifiability.estimation.search import (
    Judged,
    Search,
    Weak,
    find_candidates,
    find_rivals,
    further_gains,
    list_alternatives,
    name_terms,
)
from identifiability.foundation.linalg import scan_columns
from identifiability.foundation.names import Array, Parameter, name_each
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Fields, frozen
from identifiability.logs.prepare import Dataset
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.quality.hints import leave_out_rows
from identifiability.regression.columns import Candidate, Refusal, list_candidates, number
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import compare_models
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure, known_rows
from identifiability.robot import Robot
from identifiability.workflows.analyze.judge import select_fit
from identifiability.workflows.analyze.ladder import fit_ladder, hold_folds
from identifiability.workflows.changes import Change, rows_of

from .laws import choose_law
from .problem import (
    KnownValues,
    Problem,
    Recommended,
    ResidualRows,
    WeighedFit,
    know_nothing,
    weigh_fit,
)


@frozen
class Part:
    """A missing family at a place.

    Attributes
    ----------
    candidate : Candidate
        With its shape; its columns are numbered among those of all parts.
    term : Term
        Of the group that was found; its place may be everywhere.
    left_out, unseen : float [nat]
        Gain on left-out blocks of fitted rows, and on unseen rows; nan without any.
    rivals : tuple of Term
        Competing hypotheses, the likeliest first.
    weight : float
        Its posterior probability among all competing hypotheses.
    nearest : tuple of Term
        For a nonparametric function: the likeliest named families instead of it.
    spread : float [N·m or N]
        Error of its level because speed and exponent of its law are not known exactly.
    """

    candidate: Candidate
    term: Term
    left_out: float
    unseen: float
    rivals: Terms
    weight: float
    nearest: Terms = ()
    spread: float = 0.0

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return its parameters."""
        placed = Placed([self.candidate.part])
        return tuple(placed.parameters(robot))


@frozen
class Naming:
    """Effects that a model lacks in some logs.

    Attributes
    ----------
    problem : Problem
    fitted : ResidualRows
        The rows that are searched.
    refusals : tuple of Refusal
    search : Search
        For all that may be missing.
    missing : Missing
        The parts alone, after friction at reversals, given the model and its noise.
    before, after : tuple of Term
        Log odds of all groups, given the model, and given the named effects as well.
    refuted : tuple of (Term, float)
        Effects that fitted rows named and unseen rows refuted, with their gains there [nat].
    possible : tuple of (Term, float, float)
        Possible effects that are not named, with their gains on left-out blocks, and the gains that
        they need [nat]; nan of those without which unseen motion errs less.
    parts : tuple of Part
        The missing effects: families in the order of their discovery, each in the order of the
        robot's places.
    """

    problem: Problem
    fitted: ResidualRows
    refusals: tuple[Refusal, ...]
    search: Search
    missing: Missing
    before: Terms
    after: Terms
    refuted: tuple[tuple[Term, float], ...] = ()
    possible: Weak = ()
    parts: tuple[Part, ...] = ()

    @cached_property
    def model(self) -> MixedModel:
        """The mixed model of the parts."""
        return self.missing.model()

    @cached_property
    def terms(self) -> Terms:
        """The parts in their order, each with its variance."""
        groups = {g.key: g for g in self.model.groups}
        terms = tuple(Term(groups[p.candidate.group]) for p in self.parts)
        return self.model.update_terms(self.model.update_terms(terms))

    def values(self, k: int) -> tuple[Array, Array]:
        """Return the values of a part (m,) and their covariance (m, m)."""
        solution = self.model.solve(self.terms)
        at = rows_of(self.model, self.terms, k)
        root = solution.root[:, at]
        unit = self.model.scale[self.terms[k].columns]
        return solution.value[at] / unit, root.T @ root / np.outer(unit, unit)

    def shape_error(self, k: int) -> float:
        """Return the standard error of the shape of a part; nan for a family without a free one.

        The slope of its torque over the shape is one further column of the model.
        """
        c = self.parts[k].candidate
        if not c.family.continuous:
            return np.nan
        step = 0.01 * c.shape  # a hundredth changes the slope little
        ends = [c.shape - step, c.shape + step]
        near = [c.with_shape(x) for x in ends]
        every = tuple(number([*self.missing.candidates, *near]))
        model = replace(self.missing, candidates=every).model()
        value, _ = self.values(k)
        slope = np.append(-value, value) / (2 * step)
        columns = np.arange(model.products.size)[-len(slope) :]
        return float(model.standard_error(self.terms, columns, slope))

    def columns(self, parts: Sequence[int], joint: int) -> Array:
        """Return the columns of some parts in a joint along the fitted rows, (N, m)."""
        at = [k for p in parts for k in self.parts[p].candidate.columns]
        none = np.zeros(len(self.fitted))
        each = [self.missing.entries.get((joint, k), none) for k in at]
        return np.reshape(each, (-1, len(none))).T

    def acts(self, part: int) -> list[int]:
        """Return the joints in which a part acts."""
        own = self.parts[part].candidate.columns
        return sorted({j for j, k in self.missing.entries if k in own})

    @cached_property
    def completed(self) -> Structure:
        """The robot under the model with all parts; functions have their estimated variance."""
        plain = self.problem.plain
        robot, model = self.problem.structure.robot, plain.model
        random, own = dict(model.random), dict[str, list[EffectPart]]()
        for p, term in zip(self.parts, self.terms, strict=True):
            if set(self.names([p])) <= set(plain.columns):
                continue
            own.setdefault(p.candidate.family.name, []).append(p.candidate.part)
            if p.candidate.family.flexible:
                sd = np.sqrt(term.variance) / self.model.scale[term.columns]
                random |= name_each(self.names([p]), sd)
        if not own and plain.robot is robot:
            return plain
        texts = ([_write_part(robot, part) for part in some] for some in own.values())
        added = map(Placed, own.values(), texts)
        return Structure.of(robot, Model((*model.effects, *added), random))

    def names(self, parts: Sequence[Part]) -> list[str]:
        """Return the names of the parameters of some parts."""
        robot = self.problem.robot
        return [x.name for p in parts for x in p.parameters(robot)]

    @cached_property
    def coordinates(self) -> tuple[Array, Array]:
        """Base parameters of the completed model by values of the model and of all parts.

        ``β = base + C x``, C (b, d + m), and the prior standard deviation of x, (d + m,).
        """
        known, completed, names = self.known, self.completed, self.names(self.parts)
        own = self.of(self.problem.plain) @ known.directions
        sd = [completed.model.random.get(name, np.inf) for name in names]
        with np.errstate(divide="ignore"):
            both = np.append(1.0 / np.sqrt(known.precision), sd)
        added = completed.G[:, [completed.columns.index(name) for name in names]]
        return np.column_stack([own, added]), both

    @property
    def known(self) -> KnownValues:
        """Prior knowledge of the base parameters to which parts are added."""
        same = self.problem.plain is self.problem.structure
        return self.problem.known if same else know_nothing(self.problem.plain)

    def of(self, smaller: Structure) -> Array:
        """Return base parameters of the completed model by those of a smaller one, (b, b0)."""
        columns = self.completed.columns
        smaller_columns = [columns.index(n) for n in smaller.base.names]
        return self.completed.G[:, smaller_columns]

    @cached_property
    def regression(self) -> Regression:
        """Columns of the completed model along the fitted motion."""
        return self.problem.regression(self.completed)

    @cached_property
    def unseen_regression(self) -> Regression:
        """Columns of the completed model along unseen motion, or the fitted one without any."""
        validation = self.problem.validation
        return self.completed.regression(validation) if validation else self.regression

    @cached_property
    def excerpt_regression(self) -> Regression:
        """Columns of the completed model along the rows that are searched for effects."""
        return self.problem.regression(self.completed, self.problem.excerpt or None)

    @cached_property
    def information(self) -> Information:
        """About the base parameters of the completed model, with equal rows."""
        return gather_information(self.regression)

    @cached_property
    def weighed(self) -> WeighedFit:
        """Weighted rows about the base parameters of the completed model minus known values."""
        rows = self.information
        base = self.of(self.problem.plain) @ self.known.base
        unknown = rows.reduce(np.eye(rows.size), rows.columns, base)
        known = with_known(unknown, known_rows(*self.coordinates))
        return weigh_fit(self.problem.robot, self.problem.samples, known)

    def fit(self, parts: Sequence[int]) -> Array:
        """Return base parameters (b,) of the completed model with some parts, as in `analyze`.

        Whitened rows judge missing effects better. But with slow noise they do not determine levels
        and predict worse. Functions have their estimated variance. Weights of rows and noise are
        estimated once, with all parts, to compare many models.
        """
        fit, some = self._fit(parts)
        return self.of(self.problem.plain) @ self.known.base + some @ fit.value

    def _fit(self, parts: Sequence[int]) -> tuple[Estimate, Array]:
        """Return the fit of independent columns (b, k) of the model with some parts, and these."""
        (weighed, whole, *_), d = self.weighed, len(self.known.precision)
        by = whole.estimator
        first = self.parts[0].candidate.columns[0] if self.parts else 0
        at = [d + k - first for p in parts for k in self.parts[p].candidate.columns]
        C, sd = (x[..., [*range(d), *at]] for x in self.coordinates)
        length = np.linalg.norm(C, axis=0)
        free = np.argsort(np.isfinite(sd), kind="stable").tolist()  # before random columns
        some = C[:, scan_columns(C / np.where(length > 0, length, 1.0), free)]
        own = weighed.reduce(some, weighed.columns[: some.shape[1]])
        return by.fit(with_known(own, known_rows(C, sd) @ some, by.noise)), some

    @cached_property
    def predicts(self) -> bool:
        """Whether the missing effects improve predictions of parts of the fitted logs."""
        weighed, whole, *_ = self.weighed
        held, scores = hold_folds(weighed, whole.estimator)[0], []
        for fit, some in map(self._fit, [(), range(len(self.parts))]):
            scores.append(held.score(held.refit(fit, some), held.roots(fit, some)))
        gain = Evidence.of(*reversed(scores))
        return gain.density.value > LEVELS.nats and gain.error.value > 0

    @cached_property
    def best(self) -> Recommended:
        """The model with all parts to predict with, and its values, as `analyze` selects it.

        The models of the ladder that keep all parts are compared on parts of the fitted logs.
        """
        completed, problem = self.completed, self.problem
        if problem.recommended is None:
            return Recommended.of_base(completed, self.fit(range(len(self.parts))))
        information, fit, *_ = self.weighed
        models = compare_models(problem.ladder, completed)
        named = {*self.names(self.parts)} & {*models[0].columns}
        models = tuple(m for m in models if named <= {*m.columns})
        fits, *_ = fit_ladder(completed, models, information, fit.estimator)
        chosen = select_fit(fits)
        submodel, robot = chosen.model.submodel, chosen.robot
        real = robot.within(submodel) if robot.as_good else None
        return Recommended.of(submodel, chosen.model.estimate.value, robot, real)

    def predict_fitted(self, fits: Sequence[Array]) -> Prediction:
        """Return torque along the fitted motion by base parameters (b,) of the completed model."""
        return predict(self.regression, np.stack(fits, axis=1))

    def predict_unseen(self, fits: Sequence[Array]) -> Prediction:
        """Return torque along unseen motion by base parameters (b,) of the completed model."""
        return predict(self.unseen_regression, np.stack(fits, axis=1))

    def predict_excerpt(self, fit: Array) -> Prediction:
        """Return torque along the rows that are searched for effects."""
        return predict(self.excerpt_regression, fit[:, None])


def without_parts(naming: Naming, gone: Collection[int]) -> Naming:
    """Return a naming without some of its parts, which become possible effects."""
    first = [p for k, p in enumerate(naming.parts) if k not in gone]
    last = [naming.parts[k] for k in sorted(gone)]
    placed = [(p, replace(p.term.group, place=p.candidate.place)) for p in last]
    more = [(replace(p.term, group=group), p.left_out, np.nan) for p, group in placed]
    found = {t.key for t in naming.problem.found}
    terms = dict.fromkeys(p.term for p in first if p.term.key not in found)
    model = naming.search.model
    after = further_gains(naming.search, model.update_terms((*terms,)))
    possible = (*naming.possible, *more)
    return with_parts(replace(naming, after=after, possible=possible), first)


def look(problem: Problem, effects: Iterable[str] | None = None) -> Naming:
    """Return the effects that the model of a problem may lack, before any is named.

    Parameters
    ----------
    problem : Problem
    effects : iterable of str, optional
        Families that may be named; all by default.
    """
    s = problem.structure
    rows = _rows_of(problem, s, problem.known)
    fitted = rows[0]
    asked = {f.name: f for f in find_families(effects, commanded=problem.commanded)}
    every = {f.name: f for f in find_families(None, commanded=problem.commanded)} | asked
    motions = [x.motion for x in fitted.samples]
    families = tuple(every.values())
    listed, refused = list_candidates(s.robot, families, s.present, motions, fixed=problem.fixed)
    # Gravity that a reading has turned is in the model already, with the angles about it.
    new = asked.keys() - {e.name for e in s.model.effects}
    found = {t.key: t for t in problem.found if t.group.family in new}
    known = problem.known
    if found:
        texts = (f"{family}@{place}" for family, place in found)
        started = Structure.of(s.robot, Model.of(*s.model.texts, *texts))
        known = know_nothing(started)
        rows = _rows_of(problem, started, known)
    others = [c for c in listed if c.group not in found]
    candidates = with_reversals(s.robot, others, s.present)
    missing = Missing(candidates, rows[0].seen, known.root, families=frozenset(asked))
    search = Search(missing, rows[1].seen if rows[1:] else None)
    before = tuple(search.model.gains())
    refusals = tuple(r for r in refused if r.family in asked)
    looked = Naming(
        problem=problem,
        fitted=fitted,
        refusals=refusals,
        search=search,
        missing=missing,
        before=before,
        after=before,
    )
    parts = [_write_found(c, found[c.group]) for c in listed if c.group in found]
    return with_parts(looked, parts)


def _rows_of(problem: Problem, structure: Structure, known: KnownValues) -> list[ResidualRows]:
    """Return the fitted rows of the search under a model, and the unseen rows if there are any."""
    excerpts = problem.excerpt or problem.samples, problem.unseen_excerpt or problem.validation
    return [ResidualRows.of(problem.regression(structure, x), known) for x in excerpts if x]


def _write_found(candidate: Candidate, term: Term) -> Part:
    """Return an effect that the case has found as a part."""
    odds = [term.odds, *(rival.odds for rival in term.rivals)]
    weight = float(softmax(odds)[0])
    return Part(candidate, term, term.odds, term.unseen, term.rivals, weight)


def name_missing(looked: Naming) -> Naming:
    """Return the missing effects, found on fitted rows and not refuted by unseen rows."""
    judged = name_terms(looked.search)
    search = judged.search
    new = [p for k in range(len(judged.terms)) for p in _write_term(judged, k)]
    parts = [*looked.parts, *new]
    came = [p.candidate.family.name for p in parts]
    parts.sort(key=lambda p: (came.index(p.candidate.family.name), p.candidate.columns))
    after = further_gains(search, judged.terms)
    named = replace(
        looked,
        search=search,
        missing=search.missing,
        after=after,
        refuted=judged.refuted,
        possible=judged.possible,
    )
    named = with_parts(named, parts)
    for part in parts:
        if part.candidate.effect.exponents:
            named = with_law(named, part)
    return named


def with_law(naming: Naming, part: Part) -> Naming:
    """Return a naming with the likeliest law of a part, given the others.

    A smooth function of the velocity in its joint that gains nothing more is not missing.
    """
    place = part.candidate.place
    curve = FunctionOfVelocity.name, place
    own = {part.candidate.group, curve}
    pairs = zip(naming.parts, naming.terms, strict=True)
    rest = tuple(t for p, t in pairs if p.candidate.group not in own)
    columns = chain(*naming.search.missing.sets.get(curve, ()))
    law, spread, gain = choose_law(naming.missing, rest, part.term, part.candidate, [*columns])
    better = replace(part, candidate=law, spread=spread)
    parts = [better if p.candidate.group == part.candidate.group else p for p in naming.parts]
    if gain < RULES.name + RULES.keep:
        naming = _without_curve(naming, place)
        parts = [p for p in parts if p.candidate.group != curve]
    return with_parts(naming, parts)


def _without_curve(naming: Naming, place: str) -> Naming:
    """Return a naming in which no function of the velocity of a joint may also be missing."""
    curves = [(FunctionOfVelocity.name, x) for x in (place, EVERYWHERE)]
    possible = tuple(x for x in naming.possible if x[0].key not in curves)
    after = tuple(t for t in naming.after if t.key not in curves)
    return replace(naming, possible=possible, after=after)


def _write_term(judged: Judged, k: int) -> Iterator[Part]:
    """Yield the parts of one of the terms that are missing."""
    search, term = judged.search, judged.terms[k]
    places = judged.places[term.key]
    odds, others = list_alternatives(judged, k)
    unnamed = term.group.unnamed
    named = (t for t in others if unnamed and not t.group.unnamed)
    nearest = [t for t in named if t.group.place == term.group.place]
    weight = float(softmax([odds, *(t.odds for t in others)])[0])
    for c in find_candidates(search, judged.terms, k):
        if c.place in places:
            gains = places[c.place], judged.unseen.get(term.key, np.nan)
            yield Part(c, term, *gains, find_rivals(judged, k), weight, tuple(nearest[:3]))


def with_parts(naming: Naming, parts: Sequence[Part]) -> Naming:
    """Return a naming of some parts, numbered after friction at reversals."""
    always = [c for c in naming.missing.candidates if c.family is REVERSALS]
    numbered = number([*always, *(p.candidate for p in parts)])
    missing = Missing(
        tuple(numbered), naming.fitted.seen, naming.problem.known.root, naming.missing.noise
    )
    own = zip(parts, numbered[len(always) :], strict=True)
    renumbered = tuple(replace(p, candidate=c) for p, c in own)
    return replace(naming, missing=missing, parts=renumbered)


# Changes during a log: a mass that was gripped, a brake that dragged for seconds.
#
# No permanent effect describes them, and unseen motion cannot judge them, because only the fitted
# motion has the instant. So a group acts between two instants of a grid, all of which are its
# prior. Rows of the change are those of another robot. All later stages leave them out.


#: Effects that may begin and end during a log: a load, a brake or dirt, a counterweight.
CHANGING = ("payload", "coulomb_friction", "viscous_friction", "torque_offset")
#: Largest number of instants of a log at which something may change.
INSTANTS = 40
#: Sizes that a change may have, relative to the torque of its joint.
CHANGES = np.geomspace(0.01, 1.0, 20)
#: Shortest part of time [s].
SHORTEST: Tolerance = 0.5


def _parts_of_time(rows: Excerpt) -> tuple[np.ndarray, np.ndarray]:
    """Return rows at which parts of time begin, and the end of the last; and which log each is of.

    A change shorter than two parts is an outlier segment.
    """
    begins, log = [0], list[int]()
    for n in np.unique(rows.log):
        own = np.flatnonzero(rows.log == n)
        t = rows.t[own]
        spans = (t[-1] - t[0]) / SHORTEST
        some = max(min(INSTANTS, len(own) // 2, int(spans)), 1)
        begins_at = np.linspace(t[0], t[-1], some + 1)
        cuts = np.unique(np.searchsorted(t, begins_at[:-1]))
        starts = own[0] + cuts[1:]
        end = int(own[-1])
        begins += [*starts.tolist(), end + 1]
        log += [int(n)] * len(cuts)
    return np.array(begins), np.array(log)


def _stays(log: np.ndarray) -> np.ndarray:
    """Return the possible intervals of a change, (w, 2): first part of time, and end part.

    In a single log, a change that ends is the same as a change that begins. If a change lasts for
    most of a log, nobody knows which part changed.
    """
    out = []
    for n in np.unique(log):
        start, some = int(np.argmax(log == n)), int((log == n).sum())
        first, last = start + np.array(np.triu_indices(some + 1, 2))
        partly = (first > start) | (some < len(log))
        short = last - first <= len(log) // 2
        may = partly & short
        out.append(np.column_stack([first, last])[may])
    return np.concatenate(out)


def _session(rows: ResidualRows, begins: np.ndarray, log: np.ndarray) -> Array:
    """Return time courses of warm-up through a session, by part of time, (2, P)."""
    lasting = np.array([np.ptp(s.output_times()) for s in rows.samples])
    starts = rows.elapsed[begins[:-1]]
    elapsed = np.cumsum(lasting) - lasting
    clock = starts + elapsed[log]
    x = (clock - clock.min()) / max(float(np.ptp(clock)), 1e-9)
    return np.array([x, np.exp(-3.0 * x)])


@frozen
class _Grid:
    """Pairs of instants of the fitted logs between which something may have changed.

    Attributes
    ----------
    begins : (P + 1,) int
        Rows at which parts of time begin, and the end of the last.
    log : (P,) int
        Of each part.
    stays : (w, 2) int
        First part of each possible change, and the one after the last.
    courses : (c, P)
        Time courses of warm-up through a session.
    """

    begins: np.ndarray
    log: np.ndarray
    stays: np.ndarray
    courses: Array

    @staticmethod
    def of(rows: ResidualRows) -> _Grid:
        """Return the grid of some rows."""
        begins, log = _parts_of_time(rows.seen)
        return _Grid(begins, log, _stays(log), _session(rows, begins, log))

    @property
    def weights(self) -> Array:
        """Weight of each change, and of each time course of a session, in each part, (w + c, P)."""
        parts = np.arange(len(self.log))
        begun = parts >= self.stays[:, :1]
        not_ended = parts < self.stays[:, 1:]
        on = begun & not_ended
        return np.concatenate([on, self.courses])


def find_change_in_log(naming: Naming, effects: Collection[str] | None) -> Change | None:
    """Return the likeliest change in the middle of a log, given the named effects, if it is sure.

    Unseen motion cannot refute a change. It must therefore exceed both thresholds together, and no
    permanent effect may compete with it. For two logs nobody knows which log changed.

    Parameters
    ----------
    naming : Naming
    effects : collection of str, optional
        Families that may be named; all by default.
    """
    families = find_families([f for f in CHANGING if effects is None or f in effects])
    motions = [x.motion for x in naming.fitted.samples]
    listed, _ = list_candidates(naming.problem.robot, families, (), motions, fixed=True)
    grid = _Grid.of(naming.fitted)
    if not len(grid.stays) or not listed:  # families that nobody may name, or next to no time
        return None
    held = [c for c in naming.missing.candidates if c.family is REVERSALS]
    missing = replace(naming.missing, candidates=tuple(number([*held, *listed])), families=None)
    every = _odds_of_stays(missing, grid)
    for _ in range(2):  # its torque is no noise, so noise is estimated without it
        every = _odds_of_stays(_noise_outside(missing, grid, every[0]), grid)
    drifts = (x.drifts for x in every)
    always = [*drifts, *(t.odds for t in naming.before[:1])]
    needed = max(RULES.name + RULES.keep, *always) + RULES.rival
    return None if every[0].total < needed else _write_change(naming, grid, every)


def _noise_outside(missing: Missing, grid: _Grid, stay: _Stay) -> Missing:
    """Return the same with noise estimated outside of a change."""
    seen, noise = missing.seen, list(missing.noise)
    first, last = grid.begins[grid.stays[stay.at]].tolist()
    outside = np.ones((len(seen.y), 1), bool)
    outside[first:last] = False
    for j in {j for j, k in missing.entries if k in stay.candidate.columns}:
        (runs,) = split_runs(seen.runs[j], outside)
        noise[j] = missing.noise_within(j, runs)
    return missing.under(noise)


def _write_change(naming: Naming, grid: _Grid, every: Sequence[_Stay]) -> Change | None:
    """Return the likeliest change; None if it covers all of one of two logs."""
    best, c = every[0], every[0].candidate
    when = _find_instants(grid, best, naming.fitted.seen.t)
    if when is None:
        return None
    near = [x for x in every[1:] if x.total > best.total - RULES.rival]
    kinds = {"payload": "load", "torque_offset": "offset"}
    log = int(grid.log[grid.stays[best.at, 0]])
    parameters = Placed([c.part]).parameters(naming.problem.robot)
    weights = softmax([x.total for x in every])[0]
    return Change(
        kind=kinds.get(c.family.name, "friction"),
        family=c.family.name,
        what=best.title,
        place=c.place,
        log=naming.problem.samples[log].name,
        names=tuple(f"{c.place}.{kind.removeprefix('payload_')}" for kind in c.kinds),
        units=tuple(p.unit for p in parameters),
        sizes=best.value,
        covariance=best.covariance,
        odds=best.total,
        others=tuple(x.title for x in near),
        rivals=tuple(x.candidate.group for x in near),
        weight=float(weights),
        **when,
    )


def _find_instants(grid: _Grid, stay: _Stay, t: Array) -> Fields | None:
    """Return when a change began and ended; None if it covers all of one of two logs.

    Parameters
    ----------
    grid, stay
    t : (N,) [s]
        Of the fitted rows.
    """
    first, last = grid.stays[stay.at].tolist()
    own = np.flatnonzero(grid.log == grid.log[first])
    begun, whole = first > own[0], last > own[-1]
    if not begun and whole and len(np.unique(grid.log)) < 3:
        return None
    rows = grid.begins[[*own, own[-1] + 1]]
    begin_rows = [*rows[:-1], rows[-1] - 1]
    time, likely = t[begin_rows], softmax(stay.odds)
    starts, stops = (grid.stays - own[0]).T
    when: Fields = {}
    if begun:
        start = time[first - own[0]]
        began = _ends(starts, likely, time)
        when = {"start": float(start), "began": began}
    if not whole:
        stop = time[last - own[0]]
        ended = _ends(stops, likely, time)
        when |= {"stop": float(stop), "ended": ended}
    return when


@frozen
class _Stay:
    """A candidate with its log odds between each two instants, (w,), and its likeliest values.

    Attributes
    ----------
    total, drifts : float
        Averaged over the instants, or for a time course of the session instead, less the price.
    """

    candidate: Candidate
    odds: Array
    total: float
    drifts: float
    value: Array
    covariance: Array

    @property
    def at(self) -> int:
        """The likeliest two instants."""
        return int(self.odds.argmax())

    @property
    def title(self) -> str:
        """Name and place of the effect."""
        family = self.candidate.family
        what = "load" if family.name == "payload" else family.title
        return f"{what} of {self.candidate.place}"


def _odds_of_stays(missing: Missing, grid: _Grid) -> list[_Stay]:
    """Return candidates that act between two instants of a grid, the likeliest first."""
    model = replace(missing.model(), sizes=CHANGES)
    products = _products_of_parts(missing, model, grid)
    candidates = [x for x in missing.candidates if x.family is not REVERSALS]
    places = Counter(x.family.name for x in candidates)
    found = []
    for x in candidates:
        price = float(np.log(len(places) * places[x.family.name]))
        at = np.array(x.columns) + missing.fixed
        found.append(_odds_of_stay(model, x, at, products, grid, price))
    return sorted(found, key=lambda x: -x.total)


def _products_of_parts(missing: Missing, model: MixedModel, grid: _Grid) -> Array:
    """Return products of columns among themselves and with the torque, (P, c, c + 1)."""
    blocks = missing.products(edges=grid.begins.tolist())
    c, scale = blocks.size, np.append(model.scale, 1.0)
    rows, columns = np.arange(c)[:, None], np.arange(c + 1)
    parts = np.arange(len(grid.log))
    each = [blocks.take(parts[[b]]).between(rows, columns) for b in parts]
    return np.array(each) / np.outer(model.scale, scale)


def _beside_model(
    model: MixedModel, products: Array, at: np.ndarray, weights: Array
) -> tuple[Array, Array, Array]:
    """Return products of columns that act in parts of time, as `MixedModel.rise` takes them.

    Parameters
    ----------
    model : MixedModel
    products : (P, c, c + 1)
    at : (k,) int
        Columns of a candidate.
    weights : (s, P)
    """
    solution, own = model.plain, products[:, at]
    # Parts of time are fewer than changes, so the model's root turns them before they are added up.
    turned = own[:, :, : model.fixed] @ solution.root.T
    acts = np.flatnonzero(turned.any((0, 1)))
    S = np.tensordot(weights**2, own[:, :, at], 1)
    along = np.tensordot(weights, turned[:, :, acts], 1)
    left = np.tensordot(weights, own[:, :, -1], 1) - along @ solution.half[acts]
    return S, along @ along.transpose(0, 2, 1), left


def _odds_of_stay(
    model: MixedModel,
    candidate: Candidate,
    at: np.ndarray,
    products: Array,
    grid: _Grid,
    price: float,
) -> _Stay:
    """Return a candidate with its log odds between each two instants.

    Parameters
    ----------
    model : MixedModel
    candidate : Candidate
    at : (k,) int
        Its columns.
    products : (P, c, c + 1)
    grid : _Grid
    price : float [nat]
        Of its family and its place.
    """
    count = len(grid.stays)
    S, along, left = _beside_model(model, products, at, grid.weights)
    rise = model.rise(S, along, left)[:, 0]
    odds = logsumexp(rise, axis=1) - np.log(rise.shape[1]) - price
    halves = np.split(odds, [count])
    total, drifts = (float(logsumexp(o) - np.log(len(o))) for o in halves)
    w, size = np.unravel_index(int(rise[:count].argmax()), rise.shape)
    outside = S[w] - along[w] + np.eye(len(at)) / model.sizes[size] ** 2
    likely, unit = Normal.of(outside, left[w]), model.scale[at]
    covariance = likely.covariance / np.outer(unit, unit)
    return _Stay(candidate, odds[:count], total, drifts, likely.value / unit, covariance)


def _ends(at: np.ndarray, likely: Array, time: Array) -> tuple[float, float]:
    """Return the 95 % interval of an instant, widened by one part of time on each side."""
    inside = (at >= 0) & (at < len(time))
    share = np.cumsum(np.bincount(at[inside], likely[inside], len(time)))
    low, high = np.searchsorted(share, [0.025, 0.975]).tolist()
    ends = np.clip([low - 1, high + 1], 0, len(time) - 1)
    return float(time[ends[0]]), float(time[ends[1]])


def without_outliers(problem: Problem, outliers: Outliers) -> Problem:
    """Return a problem without outlier segments, which are treated like rows of a joint at rest."""
    samples = leave_out_rows(problem.samples, outliers)
    excerpt = leave_out_rows(problem.excerpt, outliers, problem.samples)
    return replace(problem, samples=samples, excerpt=excerpt)


def judge_all_rows(naming: Naming, problem: Problem) -> Naming:
    """Return a naming that is fitted to all rows of a problem, as in `analyze`.

    The rows that were searched remain those of curves and residuals.
    """
    searched = naming.problem
    excerpt = searched.excerpt or searched.samples
    every = replace(
        searched,
        samples=problem.samples,
        excerpt=excerpt,
        columns=problem.columns,
        restored=bool(searched.changes),
    )
    return with_parts(replace(naming, problem=every), naming.parts)


def leave_out(problem: Problem, change: Change) -> Problem | None:
    """Return a problem without the rows of a change; None if too few rows remain.

    The uncertainty of its start and end is left out as well.
    """
    at = [s.name for s in problem.samples].index(change.log)
    every = [x for x in (problem.samples, problem.excerpt) if x]
    kept = [k for k in (_outside(x[at], change) for x in every) if k is not None]
    gone = len(kept) < len(every)
    if gone:
        low, high = -np.inf, np.inf
        began, ended = (low, low), (high, high)
        change = replace(change, start=low, stop=high, began=began, ended=ended)
    rest = [(*x[:at], *([] if gone else [k]), *x[at + 1 :]) for x, k in zip_longest(every, kept)]
    if not rest[0]:
        return None
    samples, excerpt = (*rest, ())[:2]
    return replace(problem, samples=samples, excerpt=excerpt, changes=(*problem.changes, change))


def _outside(samples: Dataset, change: Change) -> Dataset | None:
    t = samples.motion.t
    rest = np.flatnonzero((t < change.began[0]) | (t > change.ended[1]))
    kept = samples.take(rest) if len(rest) else None
    if kept is None or kept.outputs < LOG_RULES.fewest:
        return None
    return replace(kept, notes=(*samples.notes, f"{change.when}: left out"))


def _write_part(robot: Robot, part: EffectPart) -> str:
    """Return an effect at its place, with its kinds and shape, as a model file writes it."""
    name, whole = part.effect.name, replace(part, kinds=())
    every = whole.find(robot)[1].values()
    shapes = part.effect.shapes(robot)
    names = (f"{part.owner}.{name}", f"{part.owner}.{name}{EXPONENT}")
    shape = ",".join(repr(float(shapes[n])) for n in names if n in shapes)
    some = "" if len(every) == len(part.kinds) else f".{'+'.join(part.kinds)}"
    where = f"{name}{some}@{part.owner}"
    return f"{where}:{shape}" if shape else where
