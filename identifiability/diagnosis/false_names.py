"""How often does a diagnosis name what is not there, on this robot and this motion?

The whole path is repeated from the raw log on, with torque that the model explains but for noise
like that of the residual: filters, derivatives, regressor, tests. Only the last step would miss
the false names that filters make.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from identifiability.diagnosis.autoregression import colour, durbin
from identifiability.diagnosis.result import Diagnosis
from identifiability.diagnosis.workflow import diagnose
from identifiability.logs import Log
from identifiability.model import Model
from identifiability.names import Array
from identifiability.robot import Robot
from identifiability.samples import Preparation, prepare_samples
from identifiability.stages import LogLike, Progress, in_memory, read_logs

#: Order of the autoregression that the residual at the full rate is copied with.
ORDER = 8


@dataclass(frozen=True)
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
    """
    say = progress or (lambda what, share: None)
    train, held = (in_memory(read_logs(x), Log) for x in (logs, validate))
    found = diagnose(robot, train, held, model=model, quick=True, seed=seed)
    make = null_maker(found, [*train, *held])
    named, sizes = [], []
    for k, stream in enumerate(np.random.SeedSequence(seed).spawn(trials)):
        say(f"repetition {k + 1}", k / trials)
        fake = make(np.random.default_rng(stream))
        d = diagnose(
            robot, fake[: len(train)], fake[len(train) :], model=Model(found.base_effects),
            quick=True, seed=seed + k,
        )  # fmt: skip
        if d.effects:
            named.append("; ".join(f"{e.name} in {', '.join(e.joints)}" for e in d.effects))
        sizes.append(d.remainder.detectable)
    families = dict.fromkeys(name for s in sizes for name in s)
    per_family = {f: np.array([s[f] for s in sizes if f in s]) for f in families}
    return FalseNames(trials, tuple(named), per_family)


def null_maker(found: Diagnosis, logs: Sequence[Log]) -> Callable[[np.random.Generator], list[Log]]:
    """Return a function that makes logs of the same motion with base torque and like noise.

    The torque is that of the base model as it is fitted beside the named effects; the noise is
    autoregressive with the covariance of what both leave.
    """
    robot = found.robot
    samples = [prepare_samples(robot, log, Preparation(decimate=1, keep_rest=True)) for log in logs]
    W = [found.model.regressor(robot, s.motion) for s in samples]
    value = _fit(np.concatenate(W), np.concatenate([s.tau for s in samples]))
    width = len(Model(found.base_effects).parameters(robot))
    torque = [w[:, :, :width] @ value[:width] for w in W]
    left = [s.tau - w @ value for s, w in zip(samples, W, strict=True)]
    series = [durbin(_covariance([r[:, j] for r in left])) for j in range(left[0].shape[1])]

    def make(rng: np.random.Generator) -> list[Log]:
        out = []
        for log, s, tau in zip(logs, samples, torque, strict=True):
            chosen = log.select(robot.joints)
            fake = np.array(chosen.tau)
            noise = [sigma * colour(rng.standard_normal(len(tau)), p) for p, sigma in series]
            fake[s.motion.kept] = tau + np.stack(noise, axis=1)
            out.append(replace(chosen, tau=fake))
        return out

    return make


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
