"""`NextMotion`: the next motion to measure, so that "A or B" becomes A, or B.

The motion maximises the torque of the named effect that its rivals and the rest of the model cannot
explain, together with the earlier logs. The log likelihood ratio of the true effect to its rival is
about normal. Its mean is half of the non-centrality, and its variance is the non-centrality.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from scipy.special import ndtr

from identifiability.effects import Part, Placed, find_family
from identifiability.estimation.rules import RULES
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import one_thread
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import NEARLY, TINY, root_diagonal
from identifiability.foundation.names import Array, Strings, name_each
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.presenter import presented
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import Progress, Run, quiet
from identifiability.foundation.values import Json, frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.excerpt import prepare_excerpt
from identifiability.logs.signals import sampling_step
from identifiability.regression.columns import list_candidates
from identifiability.regression.information import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.simulation import Trajectory
from identifiability.workflows.diagnose.result import Diagnosis, Placement, Rival

from .criteria import Ask, Discrimination, Known, Question, add_beside, gather_known
from .limits import LimitsLike, find_limits, limit_by_logs
from .result import Excitation
from .search import Series
from .workflow import find_motion

#: A motion is logged for the fewest periods, up to so many, that are as likely to decide.
PERIODS = 32
LIKELY: Tolerance = 0.95
#: Motions that the search looks at, and samples of the one that it finds.
EVALUATIONS, FINAL = 4000, 750
#: Periods of a motion that are prepared to find the information of one of many.
PREPARED = 3


@frozen
class NextMotion:
    """The motion that tells names apart, and how likely it does.

    Attributes
    ----------
    names : tuple of str
        The named effect and its rivals, as a model file writes them.
    excitation : Excitation
        The motion, which begins and ends at rest.
    periods : int
        How often it is gone through.
    chance, before : float
        Chance that the diagnosis of these logs and the new one gives only the true name, if the
        effect has its estimated size; and the same for these logs measured again.
    same : bool
        Whether all hypotheses give the same torque for every motion.
    """

    names: Strings
    excitation: Excitation
    periods: int
    chance: float
    before: float
    same: bool = False

    @property
    @presented
    def statement(self) -> str:
        """The answer in plain words."""
        raise NotImplementedError

    def to_json(self, path: str | Path) -> Path:
        """Write a trajectory file: ``identifiability simulate ROBOT FILE.json`` follows it."""
        return write_json(path, self.to_dict())

    def to_dict(self) -> Json:
        """Return a trajectory file with the properties of the motion."""
        told = {"separates": list(self.names), "chance": self.chance}
        told |= {"before": self.before, "periods": self.periods}
        return {**self.excitation.to_dict(), "comment": self.statement, "next": told}


@checked
def find_next(
    d: Diagnosis,
    *,
    limits: LimitsLike | None = None,
    duration: Positive = DEFAULTS.period,
    harmonics: Annotated[int, counted(2, 50)] = 5,
    evaluations: Annotated[int, at_least(1)] = EVALUATIONS,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> NextMotion:
    """Find the motion that decides between a name and its rivals.

    Parameters
    ----------
    d : Diagnosis
        Of several names that are "A or B", the motion decides the one with the largest torque.
    duration : float [s]
        The period. It is logged up to 32 times.
    limits : mapping, path or None
        TOML with limits of the joints, as for `excite`.
    harmonics, evaluations, seed, progress
        As for `excite`.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided, or no motion keeps the robot's limits.
    """
    with one_thread("blas"):
        d.robot.check_stands("designing the motion that decides between names")
        bench = Bench.of(d)
        known = bench.known
        step = sampling_step(d.samples[0].output_times())
        bounds = limit_by_logs(find_limits(d.robot, limits), d.samples)
        series = Series(bounds, duration, harmonics, at_rest=True)
        expected = replace(known, samples=duration / step)
        motion = find_motion(
            bench.question,
            expected,
            series,
            Run(progress or quiet, seed=seed),
            FINAL,
            evaluations,
            "next",
        )
        new = bench.along(d, motion.trajectory)
        told = bench.told(known.G + new)
        periods = 1
        chance = bench.chance(known.G + new, told)
        while periods < PERIODS and chance < LIKELY and told.any():
            periods *= 2
            chance = bench.chance(known.G + periods * new, told)
    before = bench.chance(known.G, told)
    return NextMotion(bench.question.chosen, motion, periods, chance, before, not told.any())


def decision_chance(squares: Array) -> Array:
    """Return the chance that log likelihood ratios exceed the odds up to which it is "A or B".

    `squares` are non-centralities: squares of the true effect's part outside of model and rival.
    """
    squares = np.maximum(squares, 1e-12)
    return ndtr((squares / 2 - RULES.rival) / np.sqrt(squares))


@frozen
class Bench:
    """The named effect, its rivals and the rest of the model, along the logs.

    Attributes
    ----------
    question : Question
        Its `chosen` are the name and its rivals.
    aim : Discrimination
        Of each rival two asks: either the named effect is true, or the rival with as much torque.
    known : Known
        Information of the logs.
    """

    question: Question
    aim: Discrimination
    known: Known

    @staticmethod
    def of(d: Diagnosis) -> Bench:
        """Return the undecided name with the largest torque, with each shape of its rivals.

        Raises
        ------
        IdentifiabilityError
            If nothing is undecided.
        """
        name, p, shapes = _find_undecided(d)
        text = f"{name}@{p.place}" if np.isnan(p.shape) else f"{name}@{p.place}:{float(p.shape)!r}"
        named = _name_part(d, name, p)
        effects = [[named], *shapes.values()]
        model = Model.of(*(x for x in d.model.texts if x != text))
        question = add_beside(Structure.of(d.robot, model), [Placed(parts) for parts in effects])
        first, ((own,), *others) = _find_columns(d, question, effects)
        known = gather_known(question.along(d.samples))
        by_name = name_each(p.parameters, p.values)
        parameters = Placed([named]).parameters(d.robot)
        values = np.array([by_name[one.name] for one in parameters])
        asks = _ask_rivals(known.G, own, values, others)
        aim = Discrimination(first, asks)
        names = (text, *(f"{r.family}@{r.place}" for r in shapes))
        return Bench(replace(question, criterion=aim, chosen=names), aim, known)

    def told(self, G: Array) -> np.ndarray:
        """Return the asks of which a rival leaves a residual, (rivals, 2) bool.

        If a rival contains the effect, no motion separates them unless the rival is true.
        """
        asks = self.aim.asks
        blocks = [G[np.ix_(a.own, a.own)] for a in asks]
        pairs = zip(asks, blocks, strict=True)
        whole = np.array([a.values @ g @ a.values for a, g in pairs])
        left = self.aim.squares(G[None])[:, 0]
        return np.reshape(left > 2 * NEARLY * whole, (-1, 2))

    def chance(self, G: Array, told: np.ndarray) -> float:
        """Return the chance of a decision for the least sure of the separable rivals."""
        squares = self.aim.squares(G[None])[:, 0]
        each = decision_chance(squares).reshape(-1, 2)
        some = told.any(1) | ~told.any()
        chances = np.where(told[:, 0], each[:, 0], each[:, 1])
        return float(chances[some].min())

    def along(self, d: Diagnosis, path: Trajectory) -> Array:
        """Return the Gram matrix of a period of a motion, (k, k).

        The motion is prepared like a log. The low-pass removes fast parts of the columns, such as
        differences of friction laws at a reversal.
        """
        t = np.arange(PREPARED * path.samples) * path.period / path.samples
        q = path.motion(t)[0]
        some = np.ones((len(t), len(d.robot.joints)))
        log = Log("next", d.robot.joints, t, q, some, None, None, "")
        how = None if d.preparation == Preparation() else d.preparation
        samples = prepare_excerpt(d.robot, log, how)
        k = len(self.question.columns)
        regression = self.question.along((samples,))
        R = gather_information(regression).factor(self.known.weights)[:, :k]
        # The information of a sample is known from those of the logs.
        own, theirs = (sampling_step(s.output_times()) for s in (samples, d.samples[0]))
        return R.T @ R / PREPARED * own / theirs


def _find_undecided(d: Diagnosis) -> tuple[str, Placement, dict[Rival, list[Part]]]:
    """Return the undecided name with the largest torque, its place, and the shapes of its rivals.

    A rival that these motions give no shape of is left out.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided.
    """
    found = [(p.rms, e.name, p) for e in d.effects for p in e.placements if p.rivals]
    for _, name, p in sorted(found, key=lambda one: one[:2], reverse=True):
        each = {r: list_shapes(d, r.family, r.place) for r in p.rivals}
        shapes = {rival: parts for rival, parts in each.items() if parts}
        if shapes:
            return name, p, shapes
    raise IdentifiabilityError(Finding("excite.decided"))


def _name_part(d: Diagnosis, name: str, p: Placement) -> Part:
    """Return the named effect at its place, with the kinds that were found."""
    effect = find_family(name).at(p.shape, p.place)
    kinds = (one.kind for one in effect.parameters(d.robot) if one.name in p.parameters)
    return Part(effect, p.place, tuple(kinds))


def _find_columns(
    d: Diagnosis, question: Question, effects: Sequence[Sequence[Part]]
) -> tuple[int, list[tuple[np.ndarray, ...]]]:
    """Return where the columns of effects begin, and the columns of each part of each effect."""
    widths = [len(Placed([part]).parameters(d.robot)) for parts in effects for part in parts]
    first = len(question.columns) - sum(widths)
    columns = np.arange(first, len(question.columns))
    cuts = np.cumsum(widths)[:-1]
    each = iter(np.split(columns, cuts))
    return first, [tuple(next(each) for _ in parts) for parts in effects]


def _ask_rivals(
    G: Array, own: np.ndarray, values: Array, rivals: Sequence[tuple[np.ndarray, ...]]
) -> tuple[Ask, ...]:
    """Return two asks a rival: the named effect is true, and a rival of as much torque is."""
    size = float(values @ G[np.ix_(own, own)] @ values)
    length = root_diagonal(G)
    length = np.where(length > TINY * length.max(), length, np.inf)
    asks = []
    for shapes in rivals:
        middle = shapes[len(shapes) // 2]
        alike = np.sqrt(size / len(middle)) / length[middle]
        asks += [Ask(own, values, shapes), Ask(middle, alike, (own,))]
    return tuple(asks)


def list_shapes(d: Diagnosis, name: str, place: str) -> list[Part]:
    """Return a family at a place with each shape that the logs tell apart."""
    motions = [s.motion for s in d.samples]
    every, _ = list_candidates(d.robot, [find_family(name)], (), motions, fixed=True)
    return [c.part for c in every if c.place == place]
