"""`NextMotion`: what to measure next, so that "A or B" becomes A, or B, or what is hidden shows.

The motion makes a name and all its rivals as unlike as it can, beside everything else that the
model has, together with the logs there are. Where nothing is open it shows what these logs cannot
tell from the model itself. Whether it will decide hangs on how large the effect is over the noise:
the chance is that of the very rule by which names are undecided, with the noise that the logs have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy.special import ndtr

from identifiability.effects import Part, Placed, find_family, title_of
from identifiability.effects.effect import measure_spans
from identifiability.estimation.noise import ARNoise, JointRuns, find_runs, fit_noise
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import ClosureError, IdentifiabilityError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.rounding import format_time, stated
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.columns import Candidate, list_candidates
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.simulation import Trajectory
from identifiability.workflows.diagnose.findings import Findings, Placement

SAME = 1.0 - 1e-6
from identifiability.workflows.diagnose.motion import prepare_rows, samples_each
from identifiability.workflows.excite import Excitation, Limits, find_limits
from identifiability.workflows.excite.criteria import (
    Ask,
    Discrimination,
    Known,
    Question,
    Reveal,
    Separation,
    pose_question,
)
from identifiability.workflows.excite.limits import LimitsLike
from identifiability.workflows.excite.search import Objective, Series
from identifiability.workflows.excite.workflow import find_motion
from identifiability.workflows.opening import Progress

#: A motion is logged for the fewest periods that are as likely to decide as a name is sure, up to
#: so many.
PERIODS = 32
#: Where these are not likely to, how many times as long a log may be, and how much slower a motion
#: is tried as well: it stays longer near a reversal, where laws of friction differ, and has less
#: inertia to hide them. A faster one crosses it in so few samples that how the sign of a speed is
#: smoothed counts.
LONGER, SLOWER = 4, 2
#: Looks of each search, and samples a second.
EVALUATIONS = 4000
RATE: Tolerance = 100.0
#: Names that a sentence lists.
LISTED = 4
#: Random motions that are asked whether any motion tells effects apart, and samples of each.
LOOKS, SAMPLES = 12, 150
#: Periods of a motion that are prepared to know what one of many says.
PREPARED = 3
#: Samples of a log that is longer than any share of those that are looked at.
MANY = 10**9
#: Experiments that are drawn for a chance.
DRAWN = 20_000

#: Columns of an effect, one array for each of its shapes.
Shapes = Sequence[np.ndarray]


@frozen
class NextMotion:
    """The motion that tells names apart, and how likely it does.

    Attributes
    ----------
    names : tuple of str
        What was named and its rivals, as a model file writes them; or what is hidden.
    excitation : Excitation
        The motion, which begins and ends at rest.
    periods : int
        How often it is gone through.
    chance, before : float
        That the diagnosis of these logs and the new one gives one name, the true one, where the
        effect is as large as it was found; and of these logs anew. Of what is hidden, that an
        effect as large as what is left stands out, on average.
    hidden : bool
        Whether nothing is open, and the motion shows what the model says as well in these logs.
    same : bool
        Whether it is all one torque, however the robot moves.
    """

    names: tuple[str, ...]
    excitation: Excitation
    periods: int
    chance: float
    before: float
    hidden: bool = False
    same: bool = False

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        period, k = self.excitation.trajectory.period, self.periods
        more = f", {k} times ({format_time(k * period)} in all)" if k > 1 else ""
        motion = (
            f"log this motion of {period:g} s{more}, which begins and ends at rest, and "
            "diagnose it with the logs there are"
        )
        if self.hidden:
            told = listing([_told(name) for name in self.names], LISTED)
            if self.same:
                return (
                    f"No motion was found that shows {told}: the model says the same, however the "
                    "robot moves."
                )
            return (
                f"To show {told}, which these logs cannot tell from the model, {motion}: what is "
                f"as large as the residual stands out with a chance of {_percent(self.chance)} "
                f"(without it: {_percent(self.before)}). {self.excitation.limits_statement}"
            )
        first, *others = self.names
        place = first.partition("@")[2].partition(":")[0]
        alone = all(name.partition("@")[2].partition(":")[0] == place for name in others)
        title = title_of(first.partition("@")[0]) if alone else _told(first)
        rivals = [title_of(n.partition("@")[0]) if alone else _told(n) for n in others]
        pair = f"{title} from {listing(rivals, LISTED)}" + f" in {place}" * alone
        if self.same:
            return (
                f"No motion was found that tells {pair}: beside the rest of the model they are the "
                "same torque, and either predicts it."
            )
        return (
            f"To tell {pair}, {motion}: it decides with a chance of {_percent(self.chance)}, if "
            f"the effect is as large as it was found (without it: {_percent(self.before)}). "
            f"{self.excitation.limits_statement}"
        )

    def to_json(self, path: str | Path) -> Path:
        """Write a trajectory file: ``identifiability simulate ROBOT FILE.json`` follows it."""
        return write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Return a trajectory file with what is known of the motion beside it."""
        told = {"shows" if self.hidden else "separates": list(self.names), "chance": self.chance}
        told |= {"before": self.before, "periods": self.periods}
        content = {**self.excitation.to_dict(), "comment": self.statement, "next": told}
        # Of the shapes that a rival may have the most alike one counts, not all of them together.
        del content["before"], content["after"]
        rounded: dict[str, Any] = stated(content)
        return rounded


@checked
def find_next(
    d: Findings,
    *,
    limits: LimitsLike | None = None,
    duration: Positive = 7.5,
    harmonics: Annotated[int, counted(2, 50)] = 5,
    evaluations: Annotated[int, at_least(1)] = EVALUATIONS,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> NextMotion:
    """Find the motion that decides between a name and its rivals, or shows what is hidden.

    Parameters
    ----------
    d : Diagnosis
        Of several names that are "A or B" the one with the largest torque is asked about; where
        there is none, what these logs cannot tell from the model.
    duration : float [s]
        The period. It is logged up to 32 times; where these are not likely to decide up to 128
        times, or one of twice the period up to 64 times.
    limits : Limits, mapping, path or None
        TOML with limits of the joints, as for `excite`.
    harmonics, evaluations, seed, progress
        As for `excite`.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided or hidden, or no motion keeps the robot's limits.
    """
    say = progress or (lambda what, share: None)
    with one_thread("blas"):
        d.robot.check_stands("designing the motion that decides between names")
        bounds = find_limits(d.robot, limits)
        series = Series(bounds, duration, harmonics, at_rest=True)
        asked = ask_open(d, series, seed) or ask_hidden(d, series, seed)
        if asked is None:
            raise IdentifiabilityError(
                "Nothing that was named is undecided, and nothing is hidden by the model that "
                "another motion shows, so no motion is asked for; excite --separate tells any two "
                "effects apart."
            )

        def search(series: Series, lasts: float) -> Excitation:
            return find_motion(
                asked.question,
                Known(asked.known, asked.weights, lasts / step, logs),
                series,
                samples=max(round(RATE * series.period), 4 * harmonics + 1),
                iterations=80,
                evaluations=1 if asked.same else evaluations,
                time_limit=None,
                seed=seed,
                name="next",
                say=say,
            )

        step = float(np.median(np.diff(d.samples[0].output_times())))
        logs, told = tuple(s.name for s in d.samples), Told.of(asked.question, d)
        found, longest = [search(series, duration)], PERIODS * duration
        usual = _judge(d, asked, told, found, longest)
        if usual.chance >= 1.0 - d.rules.level or asked.same:
            return usual
        with suppress(ClosureError):  # the first one keeps the workspace
            found.append(search(replace(series, period=SLOWER * duration), longest))
        return _judge(d, asked, told, found, LONGER * longest)


def _judge(
    d: Findings, asked: Asked, told: Told, found: Sequence[Excitation], longest: float
) -> NextMotion:
    """Return the shortest log that is likely to decide, or else the one that is likeliest to.

    Parameters
    ----------
    d : Findings
    asked : Asked
    told : Told
        What the logs say of it.
    found : sequence of Excitation
        Motions of one period each.
    longest : float [s]
        A log may be.
    """
    logs = []
    for motion in found:
        (new, seen), period, k = told.along(d, motion.trajectory), motion.trajectory.period, 1
        while k * period <= longest:
            logs.append((k * period, k, asked.chance(told.known + min(k, seen) * new), motion))
            k *= 2
    logs.sort(key=lambda log: log[0])
    likely = 1.0 - d.rules.level
    likeliest = max(logs, key=lambda log: log[2])  # of several the shortest
    _, periods, chance, motion = next((log for log in logs if log[2] >= likely), likeliest)
    return NextMotion(
        names=asked.names,
        excitation=motion,
        periods=periods,
        chance=chance,
        before=asked.chance(told.known),
        hidden=asked.hidden,
        same=asked.same,
    )


def _told(text: str) -> str:
    """Return an effect at its place in words."""
    name, _, place = text.partition("@")
    return f"{title_of(name)} in {place.partition(':')[0]}" if place else title_of(name)


#: From which share on a percentage is not said.
NEARLY_ALL: Tolerance = 0.99


def _percent(share: float) -> str:
    return "more than 99 %" if share > NEARLY_ALL else f"{100 * share:.0f} %"


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
        chance=lambda G: decision_chance(aim, G, d.rules.odds * placement.scatter),
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
    reach = float(np.sqrt(2.0 * (d.rules.odds + d.rules.price)))

    def chance(G: Array) -> float:
        return float(np.mean(ndtr(np.sqrt(aim.squares(G[None])[:, 0]) - reach)))

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


def _at_place(d: Findings, name: str, place: str) -> list[Candidate]:
    """Return a family at a place, with each shape that the motion of the logs tells apart."""
    motions, present = [s.motion for s in d.samples], d.structure.present
    listed, _ = list_candidates(d.robot, [find_family(name)], present, motions, fixed=d.fixed)
    return [c for c in listed if c.place == place]


def _place_one(d: Findings, name: str, place: str) -> Placed:
    """Return a family at a place, with the shape in the middle of those that are tried."""
    own = _at_place(d, name, place)
    c = own[len(own) // 2]
    return Placed([c.part], [f"{name}@{place}"])


def _text(name: str, placement: Placement) -> str:
    """Return what was named at a place, as a model file writes it."""
    place, shape = placement.place, placement.shape
    return f"{name}@{place}" if np.isnan(shape) else f"{name}@{place}:{float(shape)!r}"


def place_all(d: Findings, name: str, place: str, limits: Limits) -> tuple[Placed, list[float]]:
    """Return a family at a place with all of its shapes, those of a wider motion too."""
    motions, family = [s.motion for s in d.samples], find_family(name)
    listed = _at_place(d, name, place)
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


@frozen
class Told:
    """Information about the columns of a question.

    Attributes
    ----------
    question : Question
    noise : ARNoise
        Of the logs, beside all of these columns.
    known : (k, k)
        What the logs say.
    """

    question: Question
    noise: ARNoise
    known: Array

    @staticmethod
    def of(question: Question, d: Findings) -> Told:
        """Return what the fitted logs say."""
        W, tau, runs = _rows(question, d, d.samples)
        noise = fit_noise(tau, lambda j: [W[:, j]], runs)
        rows = noise.whiten(W, runs).reshape(-1, W.shape[2])
        return Told(question, noise, rows.T @ rows)

    def along(self, d: Findings, path: Trajectory) -> tuple[Array, float]:
        """Return what a period of a motion would say (k, k), and how many a diagnosis looks at.

        It is prepared like a log: what low-passes torque takes from the columns what is fast, such
        as where laws of friction differ at a reversal. Of a long log, which is halved, what is
        looked at is shared with the logs there are.
        """
        t = np.arange(PREPARED * path.samples) * path.period / path.samples
        q, some = path.motion(t)[0], np.ones((len(t), len(d.robot.joints)))
        log = Log("next", d.robot.joints, t, q, some, None, None, "")
        how = None if d.preparation == Preparation() else d.preparation
        samples = prepare_rows(d.robot, log, how)
        W, _, runs = _rows(self.question, d, [samples])
        rows = self.noise.whiten(W, runs).reshape(-1, W.shape[2])
        step = float(np.median(np.diff(samples.output_times())))
        each = samples_each([*(len(s.tau) for s in d.samples), MANY, MANY])
        return rows.T @ rows / PREPARED, 2 * each * step / path.period


def _rows(
    question: Question, d: Findings, samples: Sequence[Samples]
) -> tuple[Array, Array, JointRuns]:
    """Return columns (N, n, k), torque (N, n) and stretches of samples."""
    regression = Regression(d.robot, question.model, tuple(samples), question.columns)
    chunks = [(c.W.copy(), c.tau, c.data) for part in regression.parts() for c in part.chunks()]
    W, tau, data = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    return W, tau, JointRuns.of(find_runs(samples), data)


def aim_at(
    G: Array, named: Shapes, rivals: Sequence[Shapes], at: int, values: Array
) -> Discrimination:
    """Return what tells an effect, as it was found, from its rivals, and each of them from it.

    Where a rival is true it is as large as the logs take it for the named one. Of two of which one
    is a part of the other only the whole can be told from the part: where it was not found, each
    of its columns has an equal part of the torque.

    Parameters
    ----------
    G : (k, k)
        What the logs say of the columns of the model and of all these effects.
    named : sequence of (p,) int
    rivals : sequence of sequence of (q,) int
    at : int
        The shape that was found.
    values : (p,)
        With that shape.
    """
    every = [np.concatenate(list(shapes)) for shapes in (named, *rivals)]
    model = np.setdiff1d(np.arange(len(G)), np.concatenate(every))
    length = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(length, length)
    base = np.linalg.pinv(unit[np.ix_(model, model)], rcond=1e-12, hermitian=True)
    left = unit - unit[:, model] @ base @ unit[model]
    own = named[at]
    true, asks = values * length[own], []
    whole = float(true @ left[np.ix_(own, own)] @ true)
    for k, shapes in enumerate(rivals):
        found = [_explain(left, b, own, true) for b in shapes]
        best = int(np.argmax([explained for _, explained in found]))
        level, explained = found[best]
        other = shapes[best]
        nested = explained > SAME**2 * whole and len(other) > len(own)
        if nested:
            sign = np.where(level < 0, -1.0, 1.0)
            level = sign * np.linalg.norm(true) / np.sqrt(len(other))
        else:
            asks.append(Ask(k, False, own, values, tuple(shapes)))
        part = not nested and len(other) < len(own) and _within(left, other, own)
        if part:
            asks[-1] = Ask(k, False, own, values, tuple(shapes), nested=True)
        else:
            asks.append(Ask(k, True, other, level / length[other], tuple(named), nested=nested))
    return Discrimination(every[0], np.concatenate(every[1:]), tuple(asks))


def _explain(left: Array, b: np.ndarray, own: np.ndarray, true: Array) -> tuple[Array, float]:
    """Return the level (q,) at which columns explain most of an effect, and how much."""
    cross = left[np.ix_(b, own)] @ true
    level = np.linalg.pinv(left[np.ix_(b, b)], rcond=1e-9, hermitian=True) @ cross
    return level, float(level @ cross)


def _within(left: Array, small: np.ndarray, large: np.ndarray) -> bool:
    """Whether columns are a part of others, beside the model."""
    squares = sum(_explain(left, large, small[[k]], np.ones(1))[1] for k in range(len(small)))
    return squares > SAME**2 * float(np.trace(left[np.ix_(small, small)]))


def _between_shapes(left: Array) -> float:
    """Return the least that a shape between those tried (s,) leaves: they are continuous.

    That of a parabola through the best of them and its neighbours.
    """
    k = int(np.argmin(left))
    least = float(left[k])
    if not 0 < k < len(left) - 1:
        return least
    before, after = float(left[k - 1]) - least, float(left[k + 1]) - least
    return max(least - (before - after) ** 2 / max(8.0 * (before + after), 1e-300), 0.0)


def decision_chance(aim: Discrimination, G: Array, odds: float) -> float:
    """Return the chance that of several effects the true one is named alone.

    Each may be true, one as likely as the other as long as nothing tells them apart. All are
    scored by the squares that they explain; a name is undecided where the score of another comes
    within the odds that a name needs. Of a part and the whole the part is decided where the whole
    would have to explain as much more than it does.

    Parameters
    ----------
    aim : Discrimination
    G : (k, k)
        Information about its columns, in units of the noise.
    odds : float [nat]
        From which on a name is stated.
    """
    e = np.random.default_rng(0).standard_normal((2, DRAWN))
    right: dict[int, np.ndarray] = {}
    for ask in aim.asks:
        whole, left = (part[..., 0] for part in aim.squares(G[None], ask))
        truth = ask.rival + 1 if ask.reverse else 0
        own = right.get(truth, np.ones(DRAWN, bool))
        for outside in [*np.minimum(left, whole).tolist(), min(_between_shapes(left), whole)]:
            similarity = np.sqrt(1.0 - outside / max(float(whole), 1e-300))
            first = np.sqrt(whole) + e[0]
            # The other explains what is not the first one's own, and of the noise what it shares.
            second = np.sqrt(max(whole - outside, 0.0))
            second = second + similarity * e[0] + np.sqrt(max(1 - similarity**2, 0.0)) * e[1]
            ahead = 0.5 * (first**2 - second**2)
            own = own & (ahead > odds)
        right[truth] = own
        if ask.nested:
            part = 0 if ask.reverse else ask.rival + 1
            told = 0.5 * (float(left.min()) - e[1] ** 2) > odds
            right[part] = right.get(part, np.ones(DRAWN, bool)) & told
    return float(np.mean([x.mean() for x in right.values()]))
