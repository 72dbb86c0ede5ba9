"""`Rows` of a diagnosis: torque and model columns of some logs, and the motion they go with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects.functions import has_session
from identifiability.estimation.groups import Excerpt
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.known_values import KnownValues, NearFile


@frozen
class Rows:
    """Rows of one or more logs, after decimation.

    Attributes
    ----------
    seen : Excerpt
        Torque that the columns should explain, and those of the model: of one whose values are
        kept only those that have errors.
    samples : tuple of Samples
    measured, raw : (N, n) [N·m or N]
        Measured torque: low-passed like the columns, and as it was measured.
    data : (N, n) bool
        Where torque of each joint is data.
    root : (d, b)
        What is known beforehand of the values of the model, in units of its standard deviation.
    """

    seen: Excerpt
    samples: tuple[Samples, ...]
    measured: Array
    raw: Array
    data: np.ndarray
    root: Array

    @staticmethod
    def of(
        structure: Structure,
        samples: Sequence[Samples],
        kept: KnownValues | NearFile | None = None,
        *,
        fixed: bool = False,
    ) -> Rows:
        """Return the rows of some logs.

        Parameters
        ----------
        structure : Structure
        samples : sequence of Samples
        kept : KnownValues or NearFile, optional
            What is known of the values.
        fixed : bool
            Whether the model keeps them; without anything known those of the robot file.
        """
        regression = structure.regression(samples, keep=True)
        every = sum(s.outputs for s in samples)
        seen = Excerpt.of(regression, (every, 1, every))
        torque, X, root = seen.y, seen.X, np.empty((0, seen.X.shape[2]))
        if isinstance(kept, NearFile):
            seen, root = replace(seen, y=torque - X @ kept.values), kept.root
        elif kept is not None:
            own = X[:, :, kept.uncertain]
            seen, root = replace(seen, X=own, y=torque - X @ kept.values), kept.root
        elif fixed:
            seen = replace(seen, X=X[:, :, :0], y=torque - X @ structure.nominal_base)
            root = root[:, :0]
        return Rows(seen, tuple(samples), torque, seen.raw, seen.data, root)

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
