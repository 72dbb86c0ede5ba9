"""A diagnosis without a robot: columns, torque and noise that are numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from identifiability.effects.effect import Family
from identifiability.effects.friction import ViscousFriction
from identifiability.estimation.noise import ARNoise, JointNoise
from identifiability.workflows.diagnose.dictionary import Dictionary
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.rows import Candidate, Rows


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
        tau=tau,
        X=X,
        D=Dictionary.of(D),
        t=0.01 * np.arange(n),
        log=log,
        runs=list(pairwise(edges)),
        **given,
    )


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


@dataclass
class World:
    """One joint; the dictionary's columns are unit vectors e0, e1 … unless others are given.

    The model has one column of its own, at right angles to all of them; noise is white with
    unit variance, so that the level of a unit vector is its number of standard deviations.
    """

    rows: int = 400
    size: int = 12

    def unit(self, *parts: float) -> np.ndarray:
        """The column Σ parts[k] e_k, of length one."""
        basis = self.basis[:, : len(parts)] @ np.array(parts, float)
        return basis / np.linalg.norm(basis)

    @property
    def basis(self) -> np.ndarray:
        rng = np.random.default_rng(3)
        return np.linalg.qr(rng.standard_normal((self.rows, self.size + 1)))[0][:, 1:]

    @property
    def model(self) -> np.ndarray:
        rng = np.random.default_rng(3)
        return np.linalg.qr(rng.standard_normal((self.rows, self.size + 1)))[0][:, :1]

    def make(self, torque, columns, log=None) -> Rows:
        """Rows of a torque (N,) and dictionary columns [(N,), …]."""
        D = np.stack(columns, axis=1)[:, None, :]
        return make_rows(np.asarray(torque)[:, None], self.model[:, None, :], D, log)

    def bench(self, rows: Rows, draws: int, seed: int = 0) -> Bench:
        """With simulated noise whose length along every e_k is one on average."""
        rng = np.random.default_rng(seed)
        simulated = rng.standard_normal((self.rows, 1, 2 * draws))
        return Bench(rows=rows, noise=white(1.0), simulated=simulated)

    def held(self, rows: Rows) -> HeldOut:
        """The same torque judges what is chosen from it."""
        return HeldOut(train=rows, choosing=replace(rows))


@pytest.fixture
def world():
    return World()


@pytest.fixture
def candidate():
    return make_candidate


@pytest.fixture
def rows_of():
    return make_rows


@pytest.fixture
def white_noise():
    return white
