"""Does a name survive errors in the regressor? The motion is made anew with other choices.

Noise in positions and their derivatives biases every column; what is only an artefact of the
filter or of the clock changes its sign or goes away when these change a little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import comb

import numpy as np

from identifiability.estimation.noise.ar_noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Samples
from identifiability.workflows.diagnose.evidence import Bench, score_candidates, solve_values
from identifiability.workflows.diagnose.roles import Recording
from identifiability.workflows.diagnose.rows import Candidate, Rows

Prepare = Callable[[Recording, float | None, Callable[[Log], Log]], Samples]

#: Score below which an effect has not survived: a one-sided p-value of one per cent.
SURVIVES = 4.6


@frozen
class Survival:
    """How an effect fares when the motion is made anew.

    Attributes
    ----------
    variation : str
    score : float
    same_sign : bool
    """

    variation: str
    score: float
    same_sign: bool

    @property
    def survived(self) -> bool:
        """Whether the effect would still be believed."""
        return self.score > SURVIVES and self.same_sign

    @property
    def refutes(self) -> bool:
        """Whether the name must go: it hangs on how the motion was made from the log."""
        return not self.survived and self.variation not in CLOCK


#: Variations that shift the clock; they warn and do not refuse. A sample more or less moves the
#: reversal of every friction law, so that true friction of half the noise often fails them.
CLOCK = ("torque one sample earlier", "torque one sample later")
#: Differences of this order leave white noise of smooth motion.
ORDER = 8


@frozen
class Variation:
    """A way in which the motion is made anew.

    Attributes
    ----------
    name : str
    build : callable(Recording, Samples) -> Samples
        From a log and its samples as they were.
    """

    name: str
    build: Callable[[Recording, Samples], Samples]


def list_variations(
    cutoff: float | None,
    prepare: Prepare,
    rng: np.random.Generator,
) -> list[Variation]:
    """Return the ways in which the motion is made anew.

    Parameters
    ----------
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None for measured ones.
    prepare : callable(Recording, cutoff or None, callable(Log) -> Log) -> Samples
        What is given last is done to the samples first.
    rng : numpy.random.Generator
    """
    out = [
        Variation(name, partial(_shifted, by=by)) for name, by in zip(CLOCK, (1, -1), strict=True)
    ]
    out.append(
        Variation(
            "twice the noise in the motion",
            lambda log, _: prepare(log, None, partial(blur_motion, rng=rng)),
        )
    )
    if cutoff is not None:
        for name, factor in (("filter 20 % lower", 0.8), ("filter 20 % higher", 1.2)):
            out.append(Variation(name, partial(_filtered, prepare=prepare, cutoff=cutoff * factor)))
    return out


def _shifted(_: Recording, samples: Samples, by: int) -> Samples:
    return replace(samples, tau=shift_torque(samples.tau, by))


def _filtered(log: Recording, _: Samples, prepare: Prepare, cutoff: float) -> Samples:
    return prepare(log, cutoff, _as_it_is)


def _as_it_is(log: Log) -> Log:
    return log


def shift_torque(tau: Array, samples: int) -> Array:
    """Return torque (N, n) that is taken from some samples later; the ends are repeated."""
    at = np.clip(np.arange(len(tau)) + samples, 0, len(tau) - 1)
    shifted: Array = tau[at]
    return shifted


def blur_motion(log: Log, rng: np.random.Generator) -> Log:
    """Return a log with as much white noise again as its motion has [Cook & Stefanski 1994]."""

    def blur(x: Array) -> Array:
        noisy: Array = x + white_noise(x) * rng.standard_normal(x.shape)
        return noisy

    return replace(
        log, q=blur(log.q), dq=None if log.dq is None else blur(log.dq),
        ddq=None if log.ddq is None else blur(log.ddq),
    )  # fmt: skip


def white_noise(x: Array) -> Array:
    """Return the standard deviation of the white noise in smooth series (N, n), (n,)."""
    weight = sum(comb(ORDER, k) ** 2 for k in range(ORDER + 1))
    left = np.diff(x, ORDER, axis=0)
    if not len(left):
        return np.zeros(x.shape[1])
    # The median does not see the gaps of a log, across which series are not smooth.
    sd: Array = np.median(np.abs(left), axis=0) / (0.6745 * np.sqrt(weight))
    return sd


def stress_effects(
    build: Callable[[Variation], Rows],
    variations: Sequence[Variation],
    noise: ARNoise,
    chosen: Sequence[Candidate],
    values: Sequence[float],
    rng: np.random.Generator,
) -> list[list[Survival]]:
    """Return how every named candidate fares under every variation.

    Parameters
    ----------
    build : callable(Variation) -> Rows
        Rows with the columns of the chosen candidates, in their order.
    variations : sequence
    noise : ARNoise
    chosen : sequence of Candidate
    values : sequence of float
        First parameter of each candidate, for its sign.
    rng : numpy.random.Generator
    """
    out: list[list[Survival]] = [[] for _ in chosen]
    local, at = [], 0
    for c in chosen:
        local.append(replace(c, columns=tuple(range(at, at + len(c.columns)))))
        at += len(c.columns)
    for variation in variations:
        white = Bench.of(build(variation), noise, 0, rng).whiten()
        for k, c in enumerate(local):
            rest = white.columns([o for o in local if o is not c])
            free = replace(c, positive=False)
            score = float(score_candidates(white, rest, [free], null=False).fit[0])
            value = solve_values(white, np.column_stack([rest, white.D[:, list(c.columns)]]))[0]
            sign = np.sign(value[rest.shape[1]]) == np.sign(values[k]) or len(c.columns) > 1
            out[k].append(Survival(variation.name, score, bool(sign)))
    return out
