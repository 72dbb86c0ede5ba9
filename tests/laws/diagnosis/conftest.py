"""A diagnosis of numbers, and of an arm whose motion is known: torque and noise as a test says."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from identifiability.effects.effect import Family
from identifiability.effects.friction import ViscousFriction
from identifiability.estimation.noise import ARNoise, JointNoise
from identifiability.logs.prepare import Samples
from identifiability.regression.columns import Candidate
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.diagnose import Problem, Search, Setting, settle
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.rows import Dictionary, Rows

#: What an arm is asked for, unless a test says more.
USUAL = ("torque_offset", "joint_stiffness", "position_ripple", "stribeck_friction")
MODEL = ("rigid_body", "viscous_friction", "coulomb_friction")


def make_family(name: str, **flags: Any) -> Family:
    effect = ViscousFriction()
    effect.name = name
    return Family(effect, name.replace("_", " "), lambda robot: (), **flags)


def make_candidate(name, place, *columns, shape=float("nan"), kinds=(), positive=False, **flags):
    """A candidate of some columns of the dictionary; of a family of that name and its flags."""
    return Candidate(
        family=make_family(name, **flags), place=place, shape=shape,
        kinds=kinds or tuple(f"k{i}" for i in range(len(columns))), effect=ViscousFriction(),
        columns=columns, positive=positive,
    )  # fmt: skip


def make_rows(tau, X, D, log=None, **motion):
    """Rows of torque (N, n), model (N, n, b) and dictionary (N, n, c)."""
    tau = np.asarray(tau, float)
    n = len(tau)
    zero = np.zeros_like(tau)
    log = np.zeros(n, int) if log is None else np.asarray(log)
    edges = [0, *(np.flatnonzero(np.diff(log)) + 1).tolist(), n]
    given = {"q": zero, "dq": zero, "ddq": zero, "measured": tau, "raw": tau, **motion}
    return Rows(
        tau=tau, X=X, D=Dictionary.of(D), t=0.01 * np.arange(n), log=log,
        runs=list(pairwise(edges)), **given,
    )  # fmt: skip


def white(*sigma, left=None):
    """White noise of joints with known standard deviations."""
    return ARNoise(
        tuple(
            JointNoise(
                theta=np.empty(0), covariance=np.empty((0, 0)), sigma=s, dof=1e9,
                left=s**2 if left is None else left,
            )
            for s in sigma
        )
    )  # fmt: skip


def rms(torque):
    return np.sqrt(np.mean(torque**2, axis=0))


class Arm:
    """A two-link arm on known motion: two logs that are fitted, and one that is unseen."""

    def __init__(
        self,
        seconds: float = 8.0,
        step: float = 0.01,
        seed: int = 0,
        model: tuple[str, ...] = MODEL,
    ) -> None:
        self.robot = Robot.load("two-link")
        self.structure = Structure.of(self.robot, Model.of(*model))
        rng, t = np.random.default_rng(seed), np.arange(0.0, seconds, step)
        self.motions = [self._motion(t, rng) for _ in range(3)]

    def _motion(self, t, rng):
        q, dq, ddq = np.zeros((3, len(t), 2))
        for slow in 2 * np.pi * np.array([0.2, 0.43, 0.71]):
            a, phase = rng.uniform(0.3, 0.8, 2), rng.uniform(0, 2 * np.pi, 2)
            w = np.array([slow, 1.13 * slow])
            x = np.outer(t, w) + phase
            q, dq, ddq = q + a * np.sin(x), dq + a * w * np.cos(x), ddq - a * w**2 * np.sin(x)
        return complete_motion(self.robot, t, q, dq, ddq)

    def samples(self, add=(), noise=0.02, seed=0, factor=1.0):
        """Logs whose torque has some effects: names of model files with their levels.

        `noise` is a share of each joint's torque; `add` may differ from log to log.
        """
        rng = np.random.default_rng(seed)
        each = add if isinstance(add, list) else [add] * 3
        size = rms(self.torque(self.motions[0]))
        out = []
        for k, (motion, hidden) in enumerate(zip(self.motions, each, strict=True)):
            tau = self.torque(motion)
            for text, level in dict(hidden).items():
                first, W = (Model.of(text).regressor(self.robot, m).sum(2)
                            for m in (self.motions[0], motion))  # fmt: skip
                j = int(np.argmax(rms(first)))
                tau = tau + level * size[j] / rms(first)[j] * W
            tau = tau + noise * size * rng.standard_normal(tau.shape)
            out.append(Samples(f"log {k}", motion, factor * tau, None, (), ""))
        return out

    def torque(self, motion):
        """What the model says, with the file's values."""
        return self.structure.model.regressor(self.robot, motion) @ self.structure.nominal

    def problem(self, samples, effects=USUAL, **setting):
        *fitted, unseen = samples
        setting = {"fixed": False, **setting}
        return Problem(Setting(self.structure, tuple(fitted), (unseen,), **setting), effects)

    def search(self, samples, effects=USUAL, **setting):
        return Search(self.problem(samples, effects, **setting))

    def settled(self, samples, effects=USUAL, **setting):
        """What stands, as a search and a verdict."""
        search = self.search(samples, effects, **setting)
        return search, settle(search, Hypothesis())

    @staticmethod
    def names(search, verdict):
        """Family and place of all that stands."""
        return sorted(search.problem.candidates[k].group for k in verdict.hypothesis.parts)

    @staticmethod
    def cut(samples, at):
        """A log as two logs."""
        m = samples.motion
        return [
            replace(samples, name=f"{samples.name}.{k}", motion=m[part], tau=samples.tau[part])
            for k, part in enumerate((slice(0, at), slice(at, len(m))))
        ]


@pytest.fixture(scope="session")
def arm():
    return Arm()


@pytest.fixture
def candidate():
    return make_candidate


@pytest.fixture
def rows_of():
    return make_rows


@pytest.fixture
def white_noise():
    return white
