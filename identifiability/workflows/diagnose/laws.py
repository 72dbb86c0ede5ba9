"""`choose_law`: speed and exponent of a curve of friction, and the error of its level by them.

The rows between the slowest row and standstill are few, so curves of different form fit about as
well, and differ in their level at standstill. All exponents and speeds are weighed by their
likelihood, each with its level, and differences count in units of the gain that keeps a name. If a
smooth function of the velocity gains in addition to the best law, no law is exact, and the unit is
larger by that gain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from scipy.special import softmax

from identifiability.effects.effect import measure_spans
from identifiability.estimation.groups import Missing
from identifiability.estimation.mixed_model import MixedModel, Term, Terms
from identifiability.estimation.rules import RULES
from identifiability.estimation.search import odds_of_each
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, number


@frozen
class Laws:
    """Curves of one effect with each exponent (e) and speed (s), and the level of each.

    Attributes
    ----------
    speed : (s,) [rad/s or m/s]
    odds : (e, s)
        Log likelihood, up to a constant.
    level, variance : (e, s)
    """

    speed: Array
    odds: Array
    level: Array
    variance: Array

    @staticmethod
    def of(grid: Sequence[Candidate], most: float, odds: Array, level: Array, error: Array) -> Laws:
        """Return laws between those of a grid of speeds; other arrays are (e, s).

        A joint with more static friction than its largest torque, `most`, would not have moved.
        """
        log_speed = np.log([[law.shape for law in grid]])
        speed, odds, level, log_error = map(_refine, (log_speed, odds, level, np.log(error)))
        positive = level > 0
        moved = positive & (level <= most)
        odds = np.where(moved if moved.any() else positive, odds, -np.inf)
        return Laws(np.exp(speed[0]), odds, level, np.exp(2.0 * log_error))

    @property
    def best(self) -> tuple[int, int]:
        """Exponent and speed of the likeliest law."""
        exponent, speed = np.unravel_index(int(self.odds.argmax()), self.odds.shape)
        return int(exponent), int(speed)

    def spread(self, unit: float) -> float:
        """Return how far the level of the best law errs because it may be another law.

        Parameters
        ----------
        unit : float [nat]
            In which likelihoods are compared.
        """
        weight = softmax(self.odds / unit)
        square = self.variance + (self.level - self.level[self.best]) ** 2
        more = float(np.sum(weight * square)) - float(self.variance[self.best])
        return float(np.sqrt(max(more, 0.0)))


def choose_law(
    missing: Missing, terms: Terms, term: Term, own: Candidate, curve: Sequence[Candidate]
) -> tuple[Candidate, float, float]:
    """Return an effect with its likeliest speed and exponent, and the error of its level by them.

    The last number is the gain of a smooth function of the velocity in addition to it [nat].

    Parameters
    ----------
    missing : Missing
        With the effect and all others that are named.
    terms : tuple of Term
        The others.
    term : Term
    own : Candidate
    curve : sequence of Candidate
        The smooth function of the velocity at its place.
    """
    tried = [*_list_laws(missing, own)]
    model, columns = _add_candidates(missing, [*chain(*tried)])
    odds = odds_of_each(model, terms, term.group, columns)
    shape = len(tried), len(tried[0])
    levels = model.levels(terms, np.concatenate(columns))
    rows = {axis.name: axis.row for axis in missing.seen.robot.axes}
    row = rows.get(own.place)
    felt = missing.seen.raw if row is None else missing.seen.raw[:, row != 0]
    most = float(np.abs(felt).max())
    laws = Laws.of(tried[0], most, *(x.reshape(shape) for x in (odds, *levels)))
    exponent, speed = laws.best
    law = tried[exponent][0].with_shape(float(laws.speed[speed]))
    odd, gain = _gains_of_curve(missing, terms, term, law, curve)
    return law, laws.spread(RULES.keep * max(odd, 1.0)), gain


def _add_candidates(
    missing: Missing, further: Sequence[Candidate]
) -> tuple[MixedModel, list[np.ndarray]]:
    """Return the mixed model with further candidates, and the columns of each of these."""
    every = number([*missing.candidates, *further])
    model = replace(missing, candidates=tuple(every)).model()
    new = every[len(missing.candidates) :]
    return model, [np.array(c.columns) + missing.fixed for c in new]


def _list_laws(missing: Missing, own: Candidate) -> Iterator[list[Candidate]]:
    """Yield the effect with every speed of its grid, for every exponent."""
    motions = [piece.sparse.motion for piece in missing.seen.pieces]
    speeds = own.family.grid(measure_spans(missing.seen.robot, motions)[own.place])
    for exponent in own.effect.exponents:
        effect = own.family.at((speeds[0], exponent), own.place)
        law = replace(own, effect=effect)
        yield [law.with_shape(speed) for speed in speeds]


def _gains_of_curve(
    missing: Missing, terms: Terms, term: Term, law: Candidate, curve: Sequence[Candidate]
) -> tuple[float, float]:
    """Return the gain of a smooth function in addition to a law [nat]: an odd one, and any."""
    if not curve:
        return 0.0, 0.0
    model, columns = _add_candidates(missing, [law, *curve])
    with_law = replace(term, group=replace(term.group, members=(columns[0],)), member=0)
    odd = [at for c, at in zip(curve, columns[1:], strict=True) if c.kinds[0].startswith("fo")]
    members = [np.concatenate(some) for some in (odd, columns[1:])]
    free = replace(term.group, price=0.0, positive=False)
    given_law = model.update_terms((*terms, with_law))
    first, both = odds_of_each(model, given_law, free, members).tolist()
    return first, max(first, both)


def _refine(values: Array) -> Array:
    """Return values (e, s) at a hundred shapes from each of the grid to its neighbour."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - it loads optimisation

    last = values.shape[1] - 1
    spline = CubicSpline(np.arange(last + 1), values, axis=1)
    return spline(np.linspace(0, last, 100 * last + 1))
