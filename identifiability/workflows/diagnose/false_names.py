"""How often does a diagnosis name what is not there, on this robot and this motion?

The whole path is repeated from the raw log on, with torque that the model explains but for noise
like that of the residual: filters, derivatives, regressor, tests. Only the last step would miss
the false names that filters make.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import scipy

from identifiability.effects import Family, bring, find_families
from identifiability.estimation.estimate import estimate
from identifiability.estimation.noise import colour, durbin
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.information import Information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.along import known_torque
from identifiability.workflows.diagnose.result import Diagnosis, pick
from identifiability.workflows.diagnose.workflow import diagnose
from identifiability.workflows.opening import LogLike, Progress, in_memory, read_recordings

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
        ci = scipy.stats.binomtest(len(self.named), self.trials).proportion_ci()
        return float(ci.low), float(ci.high)

    @property
    def detectable(self) -> dict[str, float]:
        """Median over trials of the smallest effect of each family that stands out."""
        return {f: float(np.median(x)) for f, x in self.sizes.items()}

    def detectable_interval(self, family: str) -> tuple[float, float]:
        """Return the 95 % interval of that median from order statistics, as far as trials allow."""
        x = np.sort(self.sizes[family])
        low = int(scipy.stats.binom.ppf(0.025, len(x), 0.5))
        return float(x[max(low - 1, 0)]), float(x[min(len(x) - low, len(x) - 1)])

    def to_frame(self) -> pd.DataFrame:
        """Return one row a family: the smallest effect that stands out over the residual."""
        rows = [(f, size, *self.detectable_interval(f)) for f, size in self.detectable.items()]
        frame = pd.DataFrame(rows, columns=["effect", "size", "low", "high"])
        return frame.sort_values("size", ignore_index=True)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            **pick(self, "trials", "rate", "named", "statement", interval95="interval"),
            "false_names": len(self.named),
            "detectable": self.to_frame().to_dict("records"),
        }

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
                f"{percent(size, 2)} of the residual."
            )
        return text


def measure_false_names(
    robot: RobotLike,
    logs: Sequence[LogLike] | LogLike,
    validate: Sequence[LogLike] | LogLike = (),
    *,
    model: Model | Sequence[str] | None = None,
    preparation: Preparation | None = None,
    trials: int = 40,
    seed: int = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> FalseNames:
    """Repeat the diagnosis on simulated logs of the same motion in which nothing is missing.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs, validate, model, preparation
        As for `diagnose`.
    trials : int
    seed : int
    progress : callable(str, float), optional
    engine : Engine, optional
        Where the logs are diagnosed; by default here. The result does not depend on it.
    """
    say = progress or (lambda what, share: None)
    robot = Robot.of(robot)
    given = read_recordings(logs, validate, Conventions.of(robot), preparation)
    train, held_out = (in_memory(x, Log) for x in (given.fitted, given.held_out))
    found = diagnose(
        robot, train, held_out, model=model, preparation=preparation, quick=True, seed=seed
    )
    null = null_of(found, train, held_out, preparation)
    items = [(seed + k, s) for k, s in enumerate(np.random.SeedSequence(seed).spawn(trials))]
    results = (engine or Serial()).map(
        null, items, progress=lambda done, total: say(f"repetition {done}", done / total)
    )
    names, sizes = zip(*results, strict=True)
    families = dict.fromkeys(name for s in sizes for name in s)
    per_family = {f: np.array([s[f] for s in sizes if f in s]) for f in families}
    return FalseNames(trials, tuple(filter(None, names)), per_family)


@frozen
class Null:
    """Logs of the same motion with base torque and like noise, and how they are diagnosed.

    Attributes
    ----------
    structure : Structure
        What is diagnosed.
    families : tuple of Family
        All that may be named.
    logs : tuple of (Log, (N,) int, (N, n), (N, n) bool)
        With the robot's joints alone, rows whose torque is replaced, torque of the model there
        [N·m or N], and where a joint moves: where it sticks, torque is what it was.
    fitted : int
        How many of the logs are fitted; the others verify.
    series : tuple of ((p,), float)
        Autoregression and innovation of each joint's noise.
    preparation : Preparation or None
        How derivatives are made.
    """

    structure: Structure
    families: tuple[Family, ...]
    logs: tuple[tuple[Log, np.ndarray, Array, np.ndarray], ...]
    fitted: int
    series: tuple[tuple[Array, float], ...]
    preparation: Preparation | None = None

    def make(self, rng: np.random.Generator) -> list[Log]:
        """Return new logs."""
        out = []
        for log, kept, tau, moves in self.logs:
            fake = np.array(log.tau)
            noise = [sigma * colour(rng.standard_normal(len(tau)), p) for p, sigma in self.series]
            fake[kept] = np.where(moves, tau + np.stack(noise, axis=1), fake[kept])
            out.append(replace(log, tau=fake))
        return out

    def __call__(self, item: tuple[int, np.random.SeedSequence]) -> tuple[str, dict[str, float]]:
        """Return the name given to one repetition, if any, and what would have stood out."""
        seed, stream = item
        fake = self.make(np.random.default_rng(stream))
        train, held_out = fake[: self.fitted], fake[self.fitted :]
        names, model = bring(self.families), self.structure.model
        d = diagnose(
            self.structure.robot,
            train,
            held_out,
            model=model,
            effects=names,
            preparation=self.preparation,
            quick=True,
            seed=seed,
        )
        name = "; ".join(f"{e.name} in {', '.join(e.joints)}" for e in d.effects)
        return name, dict(d.remainder.detectable)


def null_of(
    found: Diagnosis,
    train: Sequence[Log],
    held_out: Sequence[Log],
    preparation: Preparation | None = None,
) -> Null:
    """Return logs of the same motion with base torque and like noise.

    The torque is that of the base model as it is fitted beside the named effects; the noise is
    autoregressive with the covariance of what both leave.
    """
    robot, logs = found.robot, [*train, *held_out]
    whole = replace(preparation or Preparation(), decimate=1)
    samples = [prepare_samples(robot, log, whole) for log in logs]
    moves = [np.ones(s.tau.shape, bool) if s.dwells is None else ~s.dwells for s in samples]
    W = [found.model.regressor(robot, s.motion) for s in samples]
    data = np.concatenate(moves)
    columns = np.concatenate(W) * data[:, :, None]
    tau = np.concatenate([s.tau for s in samples]) * data
    size = np.maximum(np.sqrt(np.mean(tau**2, axis=0)), 1e-12)  # joints weigh by their torque
    names, log = found.completed.columns, np.zeros(len(tau), int)
    information = Information.of_rows(names, columns / size[:, None], tau / size, log, len(tau))
    value = estimate(information, "ols").value
    width = len(found.structure.parameters)
    every = zip(samples, W, moves, strict=True)
    left = [(s.tau - w @ value) * m for s, w, m in every]
    share = np.maximum(data.mean(0), 1e-12)
    return Null(
        structure=found.structure,
        families=find_families(None),
        logs=tuple(
            (
                log.select(robot.joints),
                s.motion.kept,
                w[:, :, :width] @ value[:width] + known_torque(robot, s.motion),
                m,
            )
            for log, s, w, m in zip(logs, samples, W, moves, strict=True)
        ),
        fitted=len(train),
        series=tuple(
            durbin(_covariance(own) / part)
            for part, own in zip(share, zip(*(r.T for r in left), strict=True), strict=True)
        ),
        preparation=preparation,
    )


def _covariance(parts: Sequence[Array]) -> Array:
    """Return the autocovariances of a residual in several logs at lags 0 … ORDER."""
    total = sum(len(p) for p in parts)
    return np.array(
        [sum(float(p[k:] @ p[: len(p) - k]) for p in parts) / total for k in range(ORDER + 1)]
    )
