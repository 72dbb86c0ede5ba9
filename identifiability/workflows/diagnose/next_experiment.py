"""`NextMotion`: what to measure next, so that "A or B" becomes A, or B, or what is hidden shows.

The motion makes the torque that was named as unlike as it can what its rivals explain beside the
rest of the model, with the logs there are; where nothing is open it shows what these cannot tell
from the model. The logarithm of the likelihood ratio of the true effect to its rival is about
normal, with half of the non-centrality as its mean and all of it as its variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from typing import Annotated, Any, TypeAlias

import numpy as np
from scipy.special import ndtr

from identifiability.effects import Part, Placed, find_family, title_of
from identifiability.estimation.rules import RULES
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.rounding import format_time, stated
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.columns import list_candidates
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.simulation import Trajectory
from identifiability.workflows.diagnose.findings import Findings, Placement
from identifiability.workflows.diagnose.motion import prepare_rows, samples_each
from identifiability.workflows.excite import Excitation, find_limits
from identifiability.workflows.excite.criteria import (
    IDLE,
    Ask,
    Discrimination,
    Known,
    Question,
    add_beside,
    gather_known,
)
from identifiability.workflows.excite.limits import LimitsLike
from identifiability.workflows.excite.rules import RULES as EXCITE_RULES
from identifiability.workflows.excite.search import Objective, Series
from identifiability.workflows.excite.workflow import find_motion
from identifiability.workflows.opening import Progress

#: Similarity from which on two torques are the same one.
SAME: Tolerance = 1.0 - 1e-6
#: A motion is logged for the fewest periods, up to so many, that are as likely to decide.
PERIODS = 32
LIKELY: Tolerance = 0.95
#: Motions that the search looks at, and samples of the one that it finds.
EVALUATIONS, FINAL = 4000, 750
#: Random motions that are asked whether any motion tells effects apart, and samples of each.
LOOKS, SAMPLES = 12, 150
#: Periods of a motion that are prepared to know what one of many says.
PREPARED = 3
#: Samples of a log that is longer than its share of those that are looked at.
MANY = 10**9
#: The model alone as a rival.
NOTHING = (np.empty(0, int),)

#: Effects along motions, what they are called, and what is asked of them.
Asked: TypeAlias = "tuple[Bench, tuple[str, ...], tuple[Ask, ...]]"


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
        parts = [name.partition(":")[0].partition("@") for name in self.names]
        first, *others = (f"{title_of(family)} in {place}" for family, _, place in parts)
        pair = f"{first} from {listing(others)}"
        if self.same:
            return (
                f"No motion was found that tells {pair}: beside the rest of the model they are the "
                "same torque, and either predicts it."
            )
        goal, then = f"tell {pair}", "it decides, if the effect is as large as it was found,"
        if self.hidden:
            goal = f"show {listing([first, *others])}, which these logs cannot tell from the model"
            then = "what is as large as the residual stands out"
        period, k = self.excitation.trajectory.period, self.periods
        more = f", {k} times ({format_time(k * period)} in all)" if k > 1 else ""
        # From here on a percentage is not said.
        chance, before = (
            "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"
            for share in (self.chance, self.before)
        )
        return (
            f"To {goal}, log this motion of {period:g} s{more}, which begins and ends at rest, and "
            f"diagnose it with the logs there are: {then} with a chance of {chance} (without it: "
            f"{before}). {self.excitation.limits_statement}"
        )

    def to_json(self, path: str | Path) -> Path:
        """Write a trajectory file: ``identifiability simulate ROBOT FILE.json`` follows it."""
        return write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Return a trajectory file with what is known of the motion beside it."""
        told = {"shows" if self.hidden else "separates": list(self.names), "chance": self.chance}
        told |= {"before": self.before, "periods": self.periods}
        content = {**self.excitation.to_dict(), "comment": self.statement, "next": told}
        return dict(stated(content))


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
        The period. It is logged up to 32 times.
    limits : Limits, mapping, path or None
        TOML with limits of the joints, as for `excite`.
    harmonics, evaluations, seed, progress
        As for `excite`.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided or hidden, or no motion keeps the robot's limits.
    """
    with one_thread("blas"):
        d.robot.check_stands("designing the motion that decides between names")
        series = Series(find_limits(d.robot, limits), duration, harmonics, at_rest=True)
        asked = ask_open(d, series, seed)
        hidden = asked is None
        asked = asked or ask_hidden(d, series, seed)
        if asked is None:
            raise IdentifiabilityError(
                "Nothing that was named is undecided, and nothing is hidden by the model that "
                "another motion shows, so no motion is asked for; excite --separate tells any two "
                "effects apart."
            )
        bench, names, asks = asked
        known, aim = bench.known, Discrimination(bench.model, asks)
        same = not any(bench.tells(ask, 1.0 - SAME**2) for ask in asks)
        question = replace(bench.question, criterion=aim, chosen=names)
        motion = find_motion(
            question,
            replace(known, samples=duration / find_step(d.samples[0])),
            series,
            samples=FINAL,
            iterations=80,
            evaluations=1 if same else evaluations,
            time_limit=None,
            seed=seed,
            name="next",
            say=progress or (lambda what, share: None),
        )

        def chance_of(G: Array) -> float:
            chances = decision_chance(aim.squares(G[None])[:, 0])
            return float(chances.mean() if hidden else chances.min())

        new, seen = bench.along(d, motion.trajectory)
        periods, chance = 1, chance_of(known.G + new)
        while periods < min(PERIODS, seen) and chance < LIKELY and not same:
            periods *= 2
            chance = chance_of(known.G + min(periods, seen) * new)
    return NextMotion(names, motion, periods, chance, chance_of(known.G), hidden, same)


def decision_chance(squares: Array) -> Array:
    """Return the chance that log likelihood ratios exceed the odds up to which it is "A or B".

    `squares` are non-centralities: what of the true effect is outside of model and rival.
    """
    squares = np.maximum(squares, 1e-12)
    chance: Array = ndtr((squares / 2 - RULES.rival) / np.sqrt(squares))
    return chance


def ask_open(d: Findings, series: Series, seed: int) -> Asked | None:
    """Return the question about the undecided name with the largest torque; None without one.

    Of an effect that its rival contains no motion says more than the rival does: there the rival is
    true, as large as what was named. Rivals that no motion tells from it are left out, unless there
    are no others.
    """

    def list_rivals(name: str, p: Placement) -> list[tuple[str, str]]:
        every = dict.fromkeys((r.family, r.place) for r in p.rivals)
        return [own for own in every if own[0] != name]

    found = [(p.rms, e.name, p) for e in d.effects for p in e.placements if list_rivals(e.name, p)]
    if not found:
        return None
    _, name, p = max(found, key=lambda one: one[:2])
    text = f"{name}@{p.place}" if np.isnan(p.shape) else f"{name}@{p.place}:{float(p.shape)!r}"
    effect = find_family(name).at(p.shape, p.place)
    kinds = (one.kind for one in effect.parameters(d.robot) if one.name in p.parameters)
    named = Part(effect, p.place, tuple(kinds))
    rivals, model = list_rivals(name, p), Model.of(*(x for x in d.model.texts if x != text))
    shapes = [list_shapes(d, *own, series, seed) for own in rivals]
    bench = Bench.of(d, model, [[named], *shapes], series, seed)
    (own,), *others = bench.columns
    by_name = dict(zip(p.parameters, p.values, strict=True))
    values = np.array([by_name[one.name] for one in Placed.part_parameters(d.robot, named)])
    size = float(values @ bench.known.G[np.ix_(own, own)] @ values)
    asks: dict[str, Ask] = {}
    names = [f"{family}@{place}" for family, place in rivals]
    for rival, columns in zip(names, others, strict=True):
        back = bench.size(columns[len(columns) // 2], size, (own,))
        for ask in (Ask(own, values, columns), back):
            if bench.tells(ask, 1.0 - SAME**2):
                asks.setdefault(rival, ask)
    asks = asks or dict.fromkeys(names, Ask(own, values, others[0]))
    return bench, (text, *asks), tuple(asks.values())


def ask_hidden(d: Findings, series: Series, seed: int) -> Asked | None:
    """Return the question about what the model says as well along these logs; None if nothing is.

    Each effect is as large as what is left. Those that no motion shows are left out.
    """
    named = {(e.name, p.place) for e in d.effects for p in e.placements}
    every = dict.fromkeys((a.family, a.place) for a in d.aliases if a.structural)
    hidden = [own for own in every if own not in named and not find_family(own[0]).unnamed]
    if not hidden:
        return None
    shapes = [list_shapes(d, *own, series, seed) for own in hidden]
    bench = Bench.of(d, d.model, [[x[len(x) // 2]] for x in shapes], series, seed)
    # In units of the noise what is left is about alike in all joints.
    samples = sum(s.outputs for s in d.samples)
    left = samples * float(np.mean(bench.known.weights * d.remainder.rms**2))
    asks = [bench.size(own, left, NOTHING) for (own,) in bench.columns]
    told = [bench.tells(ask, EXCITE_RULES.visible**2) for ask in asks]
    names = tuple(f"{family}@{place}" for family, place in compress(hidden, told))
    return (bench, names, tuple(compress(asks, told))) if names else None


@frozen
class Bench:
    """Effects beside a model, along the logs and along random motions.

    `columns` are those of each effect with each of its shapes, `known` is what the logs say, and
    `grams` (m, k, k) what random motions say.
    """

    question: Question
    columns: tuple[tuple[np.ndarray, ...], ...]
    known: Known
    grams: Array

    @staticmethod
    def of(
        d: Findings, model: Model, effects: Sequence[Sequence[Part]], series: Series, seed: int
    ) -> Bench:
        """Return effects, each with all of its shapes, beside a model."""
        question = add_beside(d.robot, model, [Placed(parts) for parts in effects])
        widths = [len(Placed.part_parameters(d.robot, p)) for parts in effects for p in parts]
        first = len(question.columns) - sum(widths)
        each = iter(np.split(np.arange(first, len(question.columns)), np.cumsum(widths)[:-1]))
        columns = tuple(tuple(next(each) for _ in parts) for parts in effects)
        known = gather_known(question, d.samples, 0)
        alone = Known(0 * known.G, known.weights, float(SAMPLES))
        draws = series.draw(LOOKS, np.random.default_rng(seed))
        G, space = Objective(question, alone, series, SAMPLES).look(draws, SAMPLES)
        return Bench(question, columns, known, G[space.open == 0])

    @property
    def model(self) -> int:
        """How many columns the model has."""
        return int(self.columns[0][0][0])

    def size(self, own: np.ndarray, squares: float, others: tuple[np.ndarray, ...]) -> Ask:
        """Return an effect whose columns have equal parts of a sum of squares along the logs."""
        length = np.sqrt(np.diag(self.known.G))
        each = np.where(length > IDLE * length.max(), length, np.inf)[own]
        return Ask(own, np.sqrt(squares / len(own)) / each, others)

    def tells(self, ask: Ask, least: float) -> bool:
        """Whether any random motion leaves more than a share of the squares of an effect."""
        whole = Discrimination(0, (replace(ask, others=NOTHING),)).squares(self.grams)
        left = Discrimination(self.model, (ask,)).squares(self.grams)
        return bool((left > least * np.maximum(whole, 1e-300)).any())

    def along(self, d: Findings, path: Trajectory) -> tuple[Array, float]:
        """Return what a period of a motion would say (k, k), and how many a diagnosis looks at.

        It is prepared like a log: what low-passes torque takes from the columns what is fast, such
        as where laws of friction differ at a reversal.
        """
        t = np.arange(PREPARED * path.samples) * path.period / path.samples
        q, some = path.motion(t)[0], np.ones((len(t), len(d.robot.joints)))
        log = Log("next", d.robot.joints, t, q, some, None, None, "")
        how = None if d.preparation == Preparation() else d.preparation
        samples, columns = prepare_rows(d.robot, log, how), self.question.columns
        regression = Regression(d.robot, self.question.model, (samples,), columns)
        R = gather_information(regression).factor(self.known.weights)[:, : len(columns)]
        step = find_step(d.samples[0])  # what a sample says is known of those of the logs
        each = samples_each([*(len(s.tau) for s in d.samples), MANY])
        return R.T @ R / PREPARED * find_step(samples) / step, each * step / path.period


def find_step(samples: Samples) -> float:
    """Return the time between samples after decimation [s]."""
    return float(np.median(np.diff(samples.output_times())))


def list_shapes(d: Findings, name: str, place: str, series: Series, seed: int) -> list[Part]:
    """Return a family at a place with each shape that logs and random motions tell apart.

    Of continuous ones twice as many: what only the truth explains would else be what lies between
    two shapes of its rival.
    """
    family, draws = find_family(name), series.draw(LOOKS, np.random.default_rng(seed))
    wide = series.complete(d.robot, draws, SAMPLES)
    motions = [*(s.motion for s in d.samples), *([] if wide is None else [wide])]
    every, _ = list_candidates(d.robot, [family], (), motions, fixed=True)
    found = [c for c in every if c.place == place]
    if not family.continuous:
        return [c.part for c in found]
    ends = min(c.shape for c in found), max(c.shape for c in found)
    shapes = np.geomspace(*ends, 2 * len(found)).tolist()
    return [Part(family.at(shape, place), place, found[0].kinds) for shape in shapes]
