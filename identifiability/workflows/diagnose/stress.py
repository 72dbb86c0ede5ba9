"""Does a name survive errors in the regressor? The motion is made anew with other choices.

Noise in positions and their derivatives biases every column; what is only an artefact of the
filter or of the clock changes its sign or goes away when these change a little.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import comb

import numpy as np

from identifiability.estimation.noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.repeats import Recording
from identifiability.workflows.diagnose.evidence import Bench, score_candidates
from identifiability.workflows.diagnose.gates import CLOCK, Naming, Survival, keep_surviving
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.motion import prepare_thin, samples_each
from identifiability.workflows.diagnose.rows import Candidate, Rows, number
from identifiability.workflows.diagnose.table import build_rows
from identifiability.workflows.diagnose.values import solve_chosen

Prepare = Callable[[Recording, float | None, Callable[[Log], Log]], Samples]
#: Samples anew, from a log and its samples as they were.
Variation = Callable[[Recording, Samples], Samples]

#: A variation under which the evidence for what noise of the motion makes grows: with twice its
#: variance the effect grows by 2 to the half, its evidence by 2. That for what is in the robot does
#: not grow; half way between is the limit.
NOISIER, GROWN = "twice the noise in the motion", 2.0**0.5
#: Differences of this order leave white noise of smooth motion.
ORDER = 8


def list_variations(
    cutoff: float | None, prepare: Prepare, rng: np.random.Generator
) -> dict[str, Variation]:
    """Return the ways in which the motion is made anew, by what is done.

    Parameters
    ----------
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None for measured ones.
    prepare : callable(Recording, cutoff or None, callable(Log) -> Log) -> Samples
        What is given last is done to the samples first.
    rng : numpy.random.Generator
    """

    def shift(by: int) -> Variation:
        return lambda _, samples: replace(samples, tau=shift_torque(samples.tau, by))

    def filter_at(limit: float) -> Variation:
        return lambda log, _: prepare(log, limit, lambda same: same)

    out = {name: shift(by) for name, by in zip(CLOCK, (1, -1), strict=True)}
    blur = partial(blur_motion, rng=rng)
    out[NOISIER] = lambda log, _: prepare(log, None, blur)
    if cutoff is not None:
        for name, factor in (("filter 20 % lower", 0.8), ("filter 20 % higher", 1.2)):
            out[name] = filter_at(cutoff * factor)
    return out


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

    q = blur(log.q)
    dq, ddq = (None if x is None else blur(x) for x in (log.dq, log.ddq))
    return replace(log, q=q, dq=dq, ddq=ddq)


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
    variations: Mapping[str, Variation],
    noise: ARNoise,
    chosen: Sequence[Candidate],
    values: Sequence[float],
    scores: Sequence[float] = (),
) -> list[list[Survival]]:
    """Return how every named candidate fares under every variation.

    Parameters
    ----------
    build : callable(Variation) -> Rows
        Rows with the columns of the chosen candidates, in their order.
    variations : mapping of what is done to Variation
    noise : ARNoise
    chosen : sequence of Candidate
    values : sequence of float
        First parameter of each candidate, for its sign.
    scores : sequence of float, optional
        Of each candidate in the motion as it is.
    """
    out: list[list[Survival]] = [[] for _ in chosen]
    # Columns in these rows; a sign that cannot be is said, not scored.
    local = [replace(c, positive=False) for c in number(chosen)]
    for name, variation in variations.items():
        fares = _fare(build(variation), noise, local)
        if name == NOISIER and any(_grown(f, s) for (f, _), s in zip(fares, scores, strict=False)):
            # One noise may happen to look like the effect: the middle one of three says.
            others = [_fare(build(variation), noise, local) for _ in range(2)]
            fares = [
                sorted(each, key=lambda f: f[0])[1] for each in zip(fares, *others, strict=True)
            ]
        for k, (score, value) in enumerate(fares):
            grown = name == NOISIER and bool(scores) and _grown(score, scores[k])
            same_sign = np.sign(value[0]) == np.sign(values[k]) or len(value) > 1
            out[k].append(Survival(name, score, bool(same_sign), grown))
    return out


def _fare(rows: Rows, noise: ARNoise, chosen: Sequence[Candidate]) -> list[tuple[float, Array]]:
    """Return the score and the values of every candidate beside the others."""
    white, out = Bench(rows, noise, np.empty((*rows.tau.shape, 0))).whiten(), []
    for c in chosen:
        others = [o for o in chosen if o is not c]
        score = score_candidates(white, white.basis(others), [c], null=False).fit[0]
        out.append((float(score), solve_chosen(white, [*others, c])[-1][0]))
    return out


def _grown(score: float, before: float) -> bool:
    return bool(score > GROWN * before)


def _score_as_it_is(material: Material, chosen: Sequence[Candidate], c: Candidate) -> float:
    """Return the score of a named candidate beside the others, whatever its sign."""
    beside = material.white.basis([o for o in chosen if o is not c])
    unsigned = replace(c, positive=False)
    return float(score_candidates(material.white, beside, [unsigned], null=False).fit[0])


def stress_named(
    material: Material,
    naming: Naming,
    logs: Sequence[Recording],
    preparation: Preparation | None,
    rng: np.random.Generator,
) -> Naming:
    """Make the motion of the fitted logs anew; return what survives, and how each of it fares."""
    if not naming.chosen:
        return naming
    s = material.setting
    structure, train = s.structure, s.samples
    how, d = preparation or Preparation(), train[0].decimation
    computed = d is not None and "dq" not in logs[0].channels
    factor = None if d is None else d.factor
    most = samples_each(map(len, logs))

    def prepare(log: Recording, limit: float | None, change: Callable[[Log], Log]) -> Samples:
        changed = how if limit is None else replace(how, cutoff=limit)
        changed = replace(changed, decimate=factor)
        return prepare_thin(structure.robot, log, changed, change, most=most)

    def build(variation: Variation) -> Rows:
        changed = [variation(log, s) for log, s in zip(logs, train, strict=True)]
        named = number(naming.chosen)
        if all(now.motion is before.motion for now, before in zip(changed, train, strict=True)):
            return material.tables.train.rows_with(named, changed)
        return build_rows(structure, named, changed, s.fixed, known=s.known)

    variations = list_variations(train[0].cutoff if computed else None, prepare, rng)
    firsts = [value[0] for value, _ in solve_chosen(material.white, naming.chosen)]
    scores = [_score_as_it_is(material, naming.chosen, c) for c in naming.chosen]
    fares = stress_effects(build, variations, material.noise, naming.chosen, firsts, scores)
    refuted = [
        c for c, each in zip(naming.chosen, fares, strict=True) if any(s.refutes for s in each)
    ]
    stress = {c.slot: tuple(each) for c, each in zip(naming.chosen, fares, strict=True)}
    why = "it does not survive another preparation of the motion"
    return keep_surviving(replace(naming, stress=stress), refuted, structure.present, why)
