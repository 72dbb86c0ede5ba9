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
from identifiability.workflows.diagnose.known_values import KnownValues


@frozen
class Rows:
    """Rows of one or more logs, after decimation.

    Attributes
    ----------
    seen : Excerpt
        Torque that the columns should explain, beside what is known, and those of the model whose
        values are not exact.
    samples : tuple of Samples
    measured : (N, n) [N·m or N]
        Measured torque, low-passed like the columns.
    """

    seen: Excerpt
    samples: tuple[Samples, ...]
    measured: Array

    @staticmethod
    def of(structure: Structure, samples: Sequence[Samples], known: KnownValues) -> Rows:
        """Return the rows of some logs.

        Parameters
        ----------
        structure : Structure
        samples : sequence of Samples
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
