"""A diagnosis of numbers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from identifiability.effects.effect import Family
from identifiability.effects.friction import ViscousFriction
from identifiability.regression.columns import Candidate
from identifiability.workflows.diagnose.problem import Rows


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


@pytest.fixture
def candidate():
    return make_candidate


@pytest.fixture
def rows_of():
    return make_rows
