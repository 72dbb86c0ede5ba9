"""`Told`: what logs say of some columns, and what a motion would, with the noise that logs have."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.noise import ARNoise, JointRuns, find_runs, fit_noise
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.regression.regression import Regression
from identifiability.simulation import Trajectory
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.motion import prepare_rows, samples_each
from identifiability.workflows.excite.criteria import Question

#: Periods of a motion that are prepared to know what one of many says.
PREPARED = 3
#: Samples of a log that is longer than any share of those that are looked at.
MANY = 10**9


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
    """

    question: Question
    noise: ARNoise
    known: Array

    @staticmethod
    def of(question: Question, d: Findings) -> Told:
        """Return what the fitted logs say."""
        W, tau, runs = _rows(question, d, d.samples)
        noise = fit_noise(tau, lambda j: [W[:, j]], runs)
        rows = noise.whiten(W, runs).reshape(-1, W.shape[2])
        return Told(question, noise, rows.T @ rows)

    def along(self, d: Findings, path: Trajectory) -> tuple[Array, float]:
        """Return what a period of a motion would say (k, k), and how many a diagnosis looks at.

        It is prepared like a log: what low-passes torque takes from the columns what is fast, such
        as where laws of friction differ at a reversal. Of a long log, which is halved, what is
        looked at is shared with the logs there are.
        """
        t = np.arange(PREPARED * path.samples) * path.period / path.samples
        q, some = path.motion(t)[0], np.ones((len(t), len(d.robot.joints)))
        log = Log("next", d.robot.joints, t, q, some, None, None, "")
        how = None if d.preparation == Preparation() else d.preparation
        samples = prepare_rows(d.robot, log, how)
        W, _, runs = _rows(self.question, d, [samples])
        rows = self.noise.whiten(W, runs).reshape(-1, W.shape[2])
        step = float(np.median(np.diff(samples.output_times())))
        each = samples_each([*(len(s.tau) for s in d.samples), MANY, MANY])
        return rows.T @ rows / PREPARED, 2 * each * step / path.period


def _rows(
    question: Question, d: Findings, samples: Sequence[Samples]
) -> tuple[Array, Array, JointRuns]:
    """Return columns (N, n, k), torque (N, n) and stretches of samples."""
    regression = Regression(d.robot, question.model, tuple(samples), question.columns)
    chunks = [(c.W.copy(), c.tau, c.data) for part in regression.parts() for c in part.chunks()]
    W, tau, data = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    return W, tau, JointRuns.of(find_runs(samples), data)
