"""`Told`: what logs say of some columns, and what a motion would, with the noise that logs have."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.noise.ar_noise import ARNoise, fit_noise
from identifiability.estimation.noise.autoregression import whiten
from identifiability.estimation.noise.residual_noise import find_runs
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.regression import Regression
from identifiability.robot import complete_motion
from identifiability.simulation import Trajectory
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.excite.question import Question

#: Share of its rms speed below which a joint counts for nothing.
SLOW = 0.05


@frozen
class Told:
    """Information about the columns of a question.

    Attributes
    ----------
    question : Question
    noise : ARNoise
        Of the logs, beside all of these columns.
    known : (k, k)
        What the logs say.
    step : float [s]
        Between their samples.
    """

    question: Question
    noise: ARNoise
    known: Array
    step: float

    @staticmethod
    def of(question: Question, d: Findings) -> Told:
        """Return what the fitted logs say."""
        regression = Regression(d.robot, question.model, d.samples, question.columns)
        chunks = [(c.W.copy(), c.tau) for part in regression.parts() for c in part.chunks()]
        W, tau = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
        runs = find_runs(d.samples)
        noise = fit_noise(tau, lambda j: [W[:, j]], runs)
        step = float(np.median(np.diff(d.samples[0].output_times())))
        rows = noise.whiten(W, runs).reshape(-1, W.shape[2])
        return Told(question, noise, rows.T @ rows, step)

    def along(self, path: Trajectory) -> Array:
        """Return what one period of a motion would say, logged like the fitted logs, (k, k)."""
        robot, k = self.question.structure.robot, len(self.question.columns)
        t = np.arange(0.0, path.period, self.step)
        q, v, a = path.motion(t)
        motion = complete_motion(robot, t, q, v, a)
        W, gram = self.question.model.regressor(robot, motion), np.zeros((k, k))
        fast = np.abs(v) > SLOW * np.sqrt(np.mean(v**2, axis=0))
        for j, own in enumerate(self.noise.joints):
            # Near a reversal friction hangs on how its sign is smoothed, and logs leave rest out.
            edges = np.flatnonzero(
                np.diff(np.concatenate([[False], fast[motion.kept, j], [False]]))
            )
            runs = [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
            white = whiten(W[:, j][:, self.question.columns], runs, own.pacf) / own.sigma
            rows = np.concatenate([white[a:b] for a, b in runs] or [white[:0]])
            gram += rows.T @ rows
        return gram
