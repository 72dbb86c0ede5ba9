"""How often does a diagnosis name what is not there, on this robot and this motion?

The whole path is repeated from the raw log on, with torque that the model explains but for noise
like that of the residual: filters, derivatives, regressor, tests. Only the last step would miss
the false names that filters make.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from identifiability.effects import Effect, Family, bring, find_families
from identifiability.estimation.noise.autoregression import colour, durbin
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.regression import Model
from identifiability.robot import Robot
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.workflow import diagnose
from identifiability.workflows.opening import LogLike, Progress, in_memory, read_logs

#: Order of the autoregression that the residual at the full rate is copied with.
ORDER = 8


@frozen
class FalseNames:
    """Names given to simulated logs in which nothing is missing.

    Attributes
    ----------
    trials : int
    named : tuple of str
        One entry for every trial that was given a name.
    sizes : mapping of family to (k,)
        Smallest effect that would stand out, as a share of the residual's rms, in each trial where
        the motion shows the family.
    """

    trials: int
    named: tuple[str, ...]
    sizes: dict[str, Array]

    @property
    def rate(self) -> float:
        """Share of trials with a false name."""
        return len(self.named) / self.trials

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the rate from the number of trials [Clopper & Pearson 1934]."""
        ci = stats.binomtest(len(self.named), self.trials).proportion_ci()
        return float(ci.low), float(ci.high)

    @property
    def detectable(self) -> dict[str, float]:
        """Median over trials of the smallest effect of each family that stands out."""
        return {f: float(np.median(x)) for f, x in self.sizes.items()}

    def detectable_interval(self, family: str) -> tuple[float, float]:
        """Return the 95 % interval of that median from order statistics, as far as trials allow."""
        x = np.sort(self.sizes[family])
        low = int(stats.binom.ppf(0.025, len(x), 0.5))
        return float(x[max(low - 1, 0)]), float(x[min(len(x) - low, len(x) - 1)])

    def to_frame(self) -> pd.DataFrame:
        """Return one row a family: the smallest effect that stands out over the residual."""
        rows = [(f, size, *self.detectable_interval(f)) for f, size in self.detectable.items()]
        frame = pd.DataFrame(rows, columns=["effect", "size", "low", "high"])
        return frame.sort_values("size", ignore_index=True)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            "trials": self.trials, "false_names": len(self.named), "rate": self.rate,
            "interval95": list(self.interval), "named": list(self.named),
            "detectable": self.to_frame().to_dict("records"), "statement": self.statement,
        }  # fmt: skip

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        low, high = self.interval
        text = (
            f"In {self.trials} simulated repetitions of these logs with nothing missing, "
            f"{len(self.named)} {'was' if len(self.named) == 1 else 'were'} given a name "
            f"({100 * self.rate:.0f} %, 95 %: {100 * low:.0f} … {100 * high:.0f} %)."
        )
        if self.sizes:
            name, size = min(self.detectable.items(), key=lambda x: x[1])
            text += (
                f" The smallest effect that stands out here is {name.replace('_', ' ')} of "
                f"{100 * size:.2g} % of the residual."
            )
        return text


def measure_false_names(
    robot: Robot,
    logs: Sequence[LogLike] | LogLike,
    validate: Sequence[LogLike] | LogLike = (),
    *,
    model: Model | Sequence[str] | None = None,
    trials: int = 40,
    seed: int = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> FalseNames:
    """Repeat the diagnosis on simulated logs of the same motion in which nothing is missing.

    Parameters
    ----------
    robot : Robot
    logs, validate, model
        As for `diagnose`.
    trials : int
    seed : int
    progress : callable(str, float), optional
    engine : Engine, optional
        Where the logs are diagnosed; by default here. The result does not depend on it.
    """
    say = progress or (lambda what, share: None)
    train, held = (in_memory(read_logs(x), Log) for x in (logs, validate))
    found = diagnose(robot, train, held, model=model, quick=True, seed=seed)
    make = null_maker(found, [*train, *held])
    work = partial(_diagnose_null, make, len(train), found.base_effects, find_families(None))
    items = [(seed + k, s) for k, s in enumerate(np.random.SeedSequence(seed).spawn(trials))]
    results = (engine or Serial()).map(
        work, items, progress=lambda done, total: say(f"repetition {done}", done / total)
    )
    named, sizes = [], []
    for name, detectable in results:
        named += [name] if name else []
        sizes.append(detectable)
    families = dict.fromkeys(name for s in sizes for name in s)
    per_family = {f: np.array([s[f] for s in sizes if f in s]) for f in families}
    return FalseNames(trials, tuple(named), per_family)


def _diagnose_null(
    make: NullMaker,
    fitted: int,
    model: tuple[Effect, ...],
    families: tuple[Family, ...],
    item: tuple[int, np.random.SeedSequence],
) -> tuple[str, dict[str, float]]:
    """Return the name given to one repetition, if any, and what would have stood out."""
    seed, stream = item
    fake = make(np.random.default_rng(stream))
    d = diagnose(
        make.robot, fake[:fitted], fake[fitted:], model=Model(model), effects=bring(families),
        quick=True, seed=seed,
    )  # fmt: skip
    name = "; ".join(f"{e.name} in {', '.join(e.joints)}" for e in d.effects)
    return name, dict(d.remainder.detectable)


@frozen
class NullMaker:
    """Makes logs of the same motion with base torque and like noise.

    Attributes
    ----------
    robot : Robot
    logs : tuple of Log
        With the robot's joints alone.
    kept : tuple of (N,) int
        Rows of each log whose torque is replaced.
    torque : tuple of (N, n)
        Of the base model.
    series : tuple of ((p,), float)
        Autoregression and innovation of each joint's noise.
    """

    robot: Robot
    logs: tuple[Log, ...]
    kept: tuple[np.ndarray, ...]
    torque: tuple[Array, ...]
    series: tuple[tuple[Array, float], ...]

    def __call__(self, rng: np.random.Generator) -> list[Log]:
        """Return new logs."""
        out = []
        for log, kept, tau in zip(self.logs, self.kept, self.torque, strict=True):
            fake = np.array(log.tau)
            noise = [sigma * colour(rng.standard_normal(len(tau)), p) for p, sigma in self.series]
            fake[kept] = tau + np.stack(noise, axis=1)
            out.append(replace(log, tau=fake))
        return out


def null_maker(found: Diagnosis, logs: Sequence[Log]) -> NullMaker:
    """Return what makes logs of the same motion with base torque and like noise.

    The torque is that of the base model as it is fitted beside the named effects; the noise is
    autoregressive with the covariance of what both leave.
    """
    robot = found.robot
    samples = [prepare_samples(robot, log, Preparation(decimate=1, keep_rest=True)) for log in logs]
    W = [found.model.regressor(robot, s.motion) for s in samples]
    value = _fit(np.concatenate(W), np.concatenate([s.tau for s in samples]))
    width = len(found.structure.parameters)
    torque = tuple(w[:, :, :width] @ value[:width] for w in W)
    left = [s.tau - w @ value for s, w in zip(samples, W, strict=True)]
    series = tuple(durbin(_covariance([r[:, j] for r in left])) for j in range(left[0].shape[1]))
    chosen = tuple(log.select(robot.joints) for log in logs)
    return NullMaker(robot, chosen, tuple(s.motion.kept for s in samples), torque, series)


def _fit(W: Array, tau: Array) -> Array:
    """Return least-squares values, joints weighted by the size of their torque."""
    weight = 1.0 / np.maximum(np.sqrt(np.mean(tau**2, axis=0)), 1e-12)
    A = (W * weight[:, None]).reshape(-1, W.shape[2])
    length = np.linalg.norm(A, axis=0)
    length = np.where(length > 0, length, 1.0)
    value: Array = np.linalg.lstsq(A / length, (tau * weight).ravel(), rcond=1e-8)[0] / length
    return value


def _covariance(parts: Sequence[Array]) -> Array:
    """Return the autocovariances of a residual in several logs at lags 0 … ORDER."""
    total = sum(len(p) for p in parts)
    return np.array(
        [sum(float(p[k:] @ p[: len(p) - k]) for p in parts) / total for k in range(ORDER + 1)]
    )
