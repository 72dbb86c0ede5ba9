"""Diagnosis: how strongly the data, and simulated noise, speak for every candidate effect."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.diagnose.evidence import Whitened, score_candidates
from identifiability.workflows.diagnose.material import Setting, gather
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.workflow import usual_effects
from inside.pair import Array, Pair, timed


def measure(draws: int, candidates: int, seed: int) -> Pair:
    """Score candidates with one column beside the base model, at once and one by one.

    Parameters
    ----------
    draws : int
        Simulated noises for the units, and as many for the limits.
    candidates : int
        At most so many.
    seed : int
    """
    robot = Robot.load("3-rps")
    rngs = np.random.default_rng(seed).spawn(3)
    logs = [
        simulate(
            robot, PrescribedMotion.of(shipped_trajectory(robot, name)), rng=rng,
            hide=["stribeck_friction@slider1=0.1"],
        )
        for name, rng in zip(("571", "601"), rngs, strict=False)
    ]  # fmt: skip
    samples = tuple(prepare_rows(robot, log, None) for log in logs)
    setting = Setting(Structure.of(robot, Model.of(*usual_effects(robot))), samples)
    material = gather(setting, [], rngs[2], draws=draws)
    single = [c for c in material.candidates if len(c.columns) == 1][:candidates]
    white = material.white
    ours, scores = timed(lambda: score_candidates(white, white.basis([]), single), 5)
    slow, naive = timed(lambda: _refit_each(white, single))
    found = np.column_stack([scores.data, scores.null])
    seen = np.isfinite(found)
    gap = float(np.abs(found[seen] - naive[seen]).max() / np.abs(naive[seen]).max())
    return Pair(
        "diagnosis", "one least-squares fit a candidate and simulated noise",
        f"{len(single)} candidates, {2 * draws + 1} torques, {len(white.y)} rows",
        ours, slow, gap, 1e-6, "scores of all candidates",
    )  # fmt: skip


def _refit_each(white: Whitened, candidates: list[Candidate]) -> Array:
    """Return scores of data and limits (C, 1 + B), each from fits of its own."""
    targets = np.column_stack([white.y, white.scale, white.noise])
    draws = white.scale.shape[1]
    out = []
    for c in candidates:
        A = np.column_stack([white.X, white.D[:, c.columns[0]]])
        A = A[:, np.linalg.norm(A, axis=0) > 0]
        levels = [np.linalg.lstsq(A, t, rcond=1e-10)[0][-1] for t in targets.T]
        unit = A / np.linalg.norm(A, axis=0)
        sd = np.sqrt(np.linalg.pinv(unit.T @ unit)[-1, -1]) / np.linalg.norm(A[:, -1])
        z = np.array(levels) / sd
        z = np.delete(z / np.sqrt(np.mean(z[1 : 1 + draws] ** 2)), slice(1, 1 + draws))
        if c.positive:
            out.append(np.where(z > 0, -norm.logsf(z), 0.0))
        else:
            out.append(-(np.log(2.0) + norm.logsf(np.abs(z))))
    return np.array(out)
