"""A model that predicts no better than a constant torque answers nothing."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.logs.prepare.dataset import explain_silence
from identifiability.workflows.analyze.result import doubt


@dataclass
class Judged:
    """What is asked of a model before it may answer."""

    error_ra_validation: float = 0.1
    unseen: SimpleNamespace | None = None
    withdrawn: str = ""

    def withdraw(self, why):
        return replace(self, withdrawn=why)


def log(*, moves=True, varies=True):
    """Return what a survey says of a log of two joints."""
    return SimpleNamespace(
        survey=SimpleNamespace(
            low=np.zeros((3, 2)), high=np.full((3, 2), 1.0 * moves),
            torque_range=(np.array([0.0, 3.0]), np.array([1.0 * varies, 3.0])),
        )
    )  # fmt: skip


def doubted(error, constant, *logs):
    unseen = SimpleNamespace(constant_error=lambda: constant)
    models = Judged(error, unseen), Judged(0.01, unseen)
    silence = explain_silence([x.survey for x in logs or (log(),)])
    results, why = doubt(silence, models, 0)
    assert [r.withdrawn for r in results] == [why, why]
    return why


@pytest.mark.parametrize(
    ("error", "constant", "worse"),
    [(0.1, 0.11, False), (0.1, 0.1, True), (0.1, 0.05, True), (0.1, np.nan, True),
     (np.nan, 0.1, True)],
)  # fmt: skip
def test_the_selected_model_must_be_better_than_a_constant_torque(error, constant, worse):
    assert ("better than a constant torque would" in doubted(error, constant)) == worse
    assert (doubted(error, constant) == "") == (not worse)
