"""A diagnosis of numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identifiability.effects.effect import Family
from identifiability.effects.friction import ViscousFriction
from identifiability.estimation.mixed_model import Products
from identifiability.estimation.noise import JointNoise, JointRuns
from identifiability.regression.columns import Candidate
from identifiability.workflows.diagnose.rows import Rows


def make_family(name: str, **flags: Any) -> Family:
    effect = ViscousFriction()
    effect.name = name
    return Family(effect, name.replace("_", " "), lambda robot: (), **flags)


def make_candidate(name, place, *columns, shape=float("nan"), **flags):
    """A candidate of some columns; of a family of that name and its flags."""
    return Candidate(
        family=make_family(name, **flags), place=place, shape=shape,
        kinds=tuple(f"k{i}" for i in range(len(columns))), effect=ViscousFriction(),
        columns=columns,
    )  # fmt: skip


def make_rows(tau, **motion):
    """Rows of torque (N, n)."""
    tau = np.asarray(tau, float)
    n = len(tau)
    data = np.ones(tau.shape, bool)
    seen = SimpleNamespace(t=0.01 * np.arange(n), log=np.zeros(n, int), data=data)
    rows = Rows(seen, (), tau)
    zero = np.zeros_like(tau)
    vars(rows)["states"] = tuple(motion.get(k, zero) for k in ("q", "dq", "ddq"))
    return rows


def make_missing(tau, X, D, candidates):
    """What may be missing beside a model (N, n, b): candidates among columns (N, n, c)."""
    acts = zip(*np.nonzero(D.any(0)), strict=True)
    n, width = tau.shape[1], X.shape[2] + D.shape[2]
    rows = [np.column_stack([X[:, j], D[:, j], tau[:, j]]) for j in range(n)]
    noise = tuple(JointNoise(np.empty(0), float(np.linalg.norm(x)) or 1.0) for x in tau.T)
    runs = JointRuns.of(((0, len(tau)),), np.ones(tau.shape, bool))
    every = [np.arange(width + 1)] * n
    return SimpleNamespace(
        products=Products.of(every, rows, noise, runs, (0, len(tau))),
        root=np.empty((0, X.shape[2])), fixed=X.shape[2], seen=SimpleNamespace(y=tau, X=X),
        entries={(int(j), int(k)): D[:, j, k] for j, k in acts}, candidates=candidates,
    )  # fmt: skip


@pytest.fixture
def candidate():
    return make_candidate


@pytest.fixture
def rows_of():
    return make_rows


@pytest.fixture
def missing_of():
    return make_missing
