"""`Rows` of a diagnosis: torque and model columns of some logs, and the motion they go with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects.functions import has_session
from identifiability.estimation.groups import Excerpt
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.torque_errors import change_interval
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.problem import KnownValues


@frozen
class Rows:
    """Rows of one or more logs, after decimation.

    Attributes
    ----------
    seen : Excerpt
        Torque that the columns should explain, beside what is known, and those of the model whose
        values are not exact.
    samples : tuple of Dataset
    measured : (N, n) [N·m or N]
        Measured torque, low-passed like the columns.
    """

    seen: Excerpt
    samples: tuple[Dataset, ...]
    measured: Array

    @staticmethod
    def of(structure: Structure, samples: Sequence[Dataset], known: KnownValues) -> Rows:
        """Return the rows of some logs.

        Parameters
        ----------
        structure : Structure
        samples : sequence of Dataset
        known : KnownValues
            What is known of the values beforehand.
        """
        regression = structure.regression(samples, keep=True)
        every = sum(s.outputs for s in samples)
        seen = Excerpt.of(regression, (every, 1, every))
        torque, X = seen.y, seen.X
        seen = replace(seen, X=X[:, :, known.free], y=torque - X @ known.values)
        return Rows(seen, tuple(samples), torque)

    @property
    def data(self) -> np.ndarray:
        """Where torque of each joint is data, (N, n) bool."""
        return self.seen.data

    def of_robot(self, robot: Robot) -> Rows:
        """Return the same of a robot whose loads are known by other values."""
        return replace(self, seen=replace(self.seen, robot=robot))

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.measured)

    @property
    def t(self) -> Array:
        """Time of each log, (N,) [s]."""
        return self.seen.t

    @property
    def log(self) -> np.ndarray:
        """Which log a row comes from, (N,) int."""
        return self.seen.log

    @cached_property
    def counts(self) -> np.ndarray:
        """Rows of each joint that are data, one at least, (n,)."""
        rows: np.ndarray = np.maximum(self.data.sum(0), 1)
        return rows

    @cached_property
    def states(self) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of the actuated joints, (N, n) each."""
        parts = []
        for s in self.samples:
            at, m = s.output_times(), s.motion
            both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
            parts.append(np.stack([np.interp(at, m.t, x) for x in both.T], axis=1))
        q, dq, ddq = np.split(np.concatenate(parts), 3, axis=1)
        return q, dq, ddq

    def along(self, j: int) -> dict[str, Array]:
        """Return what the residual of joint j may depend on, each (N,)."""
        q, dq, ddq = (x[:, j] for x in self.states)
        out = {"velocity": dq, "position": q, "acceleration": ddq, "load": self.measured[:, j]}
        out |= {"time": self.t, "log": self.log}
        starts = [s.motion.start or 0.0 for s in self.samples]
        if has_session([s.motion for s in self.samples]):
            out["session"] = self.t + np.array(starts)[self.log]
        return out


#: Bins in which the residual is averaged.
BINS = 12


@frozen
class Gap:
    """Prediction errors of several models on the same rows.

    Attributes
    ----------
    rows : Rows
        Where they are.
    residual : (N, n, m) [N·m or N]
    """

    rows: Rows
    residual: Array

    @cached_property
    def prediction(self) -> Prediction:
        """Torque as these models predict it."""
        own, tau = self.rows, self.rows.measured
        logs, log = np.unique(own.log, return_inverse=True)
        t = [own.t[log == k] for k in range(len(logs))]
        return Prediction.of(t, tau, tau[:, :, None] - self.residual, log, own.data)

    def interval(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of ε_RA from one model to another."""
        tau, data = self.rows.measured, self.rows.data
        deviation = np.abs(tau - tau.sum() / data.sum()) * data
        return change_interval(np.abs(self.residual[:, :, [first, second]]), deviation, rng, draws)


@frozen
class Discrepancy:
    """Where the residual of a joint sits.

    Attributes
    ----------
    joint : str
    rms : float [N·m or N]
    share : float
        Of the measured torque's rms.
    explained : mapping
        Share of the residual's variance that its averages over bins of velocity, position,
        acceleration, load, time, log and session explain, beyond what white noise would.
    """

    joint: str
    rms: float
    share: float
    explained: dict[str, float]


def find_discrepancies(
    rows: Rows, residual: Array, joints: Sequence[str]
) -> tuple[Discrepancy, ...]:
    """Return where the residual (N, n) of each joint sits."""
    out = []
    for j, joint in enumerate(joints):
        data = rows.data[:, j]
        r = residual[data, j]
        if not len(r):
            out.append(Discrepancy(joint, 0.0, 0.0, {}))
            continue
        explained = {name: explained_share(x[data], r) for name, x in rows.along(j).items()}
        size, whole = (float(np.sqrt(np.mean(x**2))) for x in (r, rows.measured[data, j]))
        out.append(Discrepancy(joint, size, size / (whole or 1.0), explained))
    return tuple(out)


def explained_share(x: Array, r: Array) -> float:
    """Return the share of the variance of r that its means over bins of x explain, adjusted."""
    values = np.unique(x)
    if len(values) <= BINS:
        index = np.searchsorted(values, x)
    else:
        index = np.empty(len(x), int)
        index[np.argsort(x, kind="stable")] = np.arange(len(x)) * BINS // len(x)
    counts = np.bincount(index).astype(float)
    means = np.bincount(index, r) / np.maximum(counts, 1)
    between = float((counts * (means - r.mean()) ** 2).sum())
    total = float(((r - r.mean()) ** 2).sum())
    k = int((counts > 0).sum())
    if total <= 0 or len(r) <= k or k < 2:
        return 0.0
    adjusted = 1 - (1 - between / total) * (len(r) - 1) / (len(r) - k)
    return float(np.clip(adjusted, 0.0, 1.0))
