"""Diagnosis: how strongly the data, and other torques, speak for every candidate effect."""

from __future__ import annotations

import numpy as np

from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.diagnose import Problem, Setting
from identifiability.workflows.diagnose.evidence import Options
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.workflow import usual_effects
from inside.pair import Array, Pair, timed


def measure(draws: int, candidates: int, seed: int) -> Pair:
    """Give candidates with one column their Bayes factors, from products and one by one.

    Parameters
    ----------
    draws : int
        Other torques along the same rows.
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
    p = Problem(setting)
    single = [c for c in p.candidates if len(c.columns) == 1 and not c.positive][:candidates]
    options, view = Options(single), p.view(())
    at = [c.columns[0] for c in single]
    rows = [p.fitted.whitened(j, int(step), at) for j, step in enumerate(view.steps)]
    torques = rngs[2].standard_normal((sum(map(len, rows)), draws))
    products = np.zeros((rows[0].shape[1] - len(at) + len(p.sizes), draws))
    for j, part in enumerate(np.split(torques, np.cumsum([len(r) for r in rows])[:-1])):
        whole = p.fitted.whitened(j, int(view.steps[j]), p.fitted.ids[j])
        b = rows[0].shape[1] - len(at)
        products[np.r_[:b, b + p.fitted.ids[j]]] += whole.T @ (part / view.tempered[j])
    evidence = view.evidence
    b = len(products) - len(p.sizes)
    z = evidence.project(products[:b], products[b:])
    ours, found = timed(lambda: evidence.gains((), options, setting.rules.alias, z), 5)
    weighed = np.concatenate([r / np.sqrt(t) for r, t in zip(rows, view.tempered, strict=True)])
    scale = np.repeat(1 / np.sqrt(view.tempered), [len(r) for r in rows])[:, None]
    slow, naive = timed(lambda: _refit_each(weighed, torques * scale, p.sizes[at]))
    seen = np.isfinite(found)
    gap = float(np.abs(found[seen] - naive[seen]).max() / np.abs(naive[seen]).max())
    return Pair(
        "diagnosis", "one orthogonal projection a candidate and torque",
        f"{len(single)} candidates, {draws} torques, {len(weighed)} rows",
        ours, slow, gap, 1e-6, "Bayes factors of all candidates",
    )  # fmt: skip


def _refit_each(rows: Array, torques: Array, sizes: Array) -> Array:
    """Return log Bayes factors (C, T), each from a projection of its own."""
    b = rows.shape[1] - len(sizes)
    out = []
    for k, size in enumerate(sizes):
        X = rows[:, 1:b]
        length = np.linalg.norm(X, axis=0)
        U, s, _ = np.linalg.svd(X[:, length > 0] / length[length > 0], full_matrices=False)
        Q = U[:, s > 1e-5 * s[0]]
        x = rows[:, b + k] * size
        x = x - Q @ (Q.T @ x)
        square = float(x @ x)
        out.append(0.5 * (x @ torques) ** 2 / (1 + square) - 0.5 * np.log1p(square))
    return np.array(out)
