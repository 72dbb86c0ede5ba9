"""Does a name survive errors in the regressor? The motion is made anew with other choices.

Noise in positions and their derivatives biases every column; what is only an artefact of the
filter or of the clock changes its sign or goes away when these change a little.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from identifiability.diagnosis.ar_noise import ARNoise
from identifiability.diagnosis.evidence import Bench, score_candidates, solve_values
from identifiability.diagnosis.rows import Candidate, Rows
from identifiability.log import Log
from identifiability.samples import Preparation

#: Score below which an effect has not survived: a one-sided p-value of one per cent.
SURVIVES = 4.6


@dataclass(frozen=True)
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


Variation = tuple[str, Callable[[Log], Log], Callable[[Preparation], Preparation]]


def list_variations(cutoff: float | None) -> list[Variation]:
    """Return the ways in which the motion is made anew.

    Parameters
    ----------
    cutoff : float or None [Hz]
        Low-pass of computed derivatives; None for measured ones.
    """
    out: list[Variation] = [
        ("torque one sample earlier", lambda log: shift_torque(log, 1), lambda how: how),
        ("torque one sample later", lambda log: shift_torque(log, -1), lambda how: how),
    ]
    if cutoff is not None:
        for name, factor in (("filter 20 % lower", 0.8), ("filter 20 % higher", 1.2)):
            chosen = cutoff * factor
            out.append((name, lambda log: log, partial(_with_cutoff, cutoff=chosen)))
    return out


def _with_cutoff(how: Preparation, cutoff: float) -> Preparation:
    return replace(how, cutoff=cutoff)


def shift_torque(log: Log, samples: int) -> Log:
    """Return a log whose torque is taken from some samples later, the motion as it is."""
    keep = slice(0, len(log) - samples) if samples > 0 else slice(-samples, None)
    move = slice(samples, None) if samples > 0 else slice(0, len(log) + samples)
    return replace(
        log, t=log.t[keep], q=log.q[keep], tau=log.tau[move],
        dq=None if log.dq is None else log.dq[keep],
        ddq=None if log.ddq is None else log.ddq[keep],
    )  # fmt: skip


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
            free = replace(c, family=replace(c.family, positive=False))
            score = float(score_candidates(white, rest, [free], null=False).fit[0])
            value = solve_values(white, np.column_stack([rest, white.D[:, list(c.columns)]]))[0]
            sign = np.sign(value[rest.shape[1]]) == np.sign(values[k]) or len(c.columns) > 1
            out[k].append(Survival(variation[0], score, bool(sign)))
    return out
