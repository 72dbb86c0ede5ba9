"""The answer in words follows the counts and errors."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.verdict import Class
from identifiability.logs.prepare.samples import explain_silence
from identifiability.workflows.analyze.result import doubt, state_physics


@dataclass
class Judged:
    """What a statement asks of a model."""

    name: str = "small"
    identifiable: int = 3
    size: int = 5
    error_ra_validation: float = 0.1
    error_ra_physical: float = 0.2
    infeasible: tuple = ()
    contradicted: str = ""
    feasible: bool = True
    physical_used: bool = False
    kept: int = 5
    unjudged: str = ""
    found: object = "a nearest real robot"
    certificate: object = field(default=object)

    @property
    def submodel(self):
        return range(self.size)

    @property
    def estimate(self):
        return SimpleNamespace(kept=range(self.kept))

    @property
    def physical(self):
        return SimpleNamespace(
            certificate=self.certificate, nearest=self.found, cad_weight=0.0, sentence="Not found.",
        )  # fmt: skip

    withdrawn: str = ""

    def withdraw(self, why):
        return replace(self, withdrawn=why)

    def count(self, kind):
        return self.identifiable if kind is Class.IDENTIFIABLE else 0


def log(*, moves=True, varies=True):
    """Return what a survey says of a log of two joints."""
    return SimpleNamespace(
        survey=SimpleNamespace(
            low=np.zeros((3, 2)), high=np.full((3, 2), 1.0 * moves),
            torque_range=(np.array([0.0, 3.0]), np.array([1.0 * varies, 3.0])),
        )
    )  # fmt: skip


def doubted(error, constant, *logs):
    models = (Judged(error_ra_validation=error), Judged(error_ra_validation=0.01))
    held_out = SimpleNamespace(constant_error=lambda: constant)
    silence = explain_silence([x.survey for x in logs or (log(),)])
    results, why = doubt(silence, models, 0, held_out)
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


def test_logs_in_which_nothing_happens_are_doubted_whatever_the_error():
    still, flat = log(moves=False), log(varies=False)
    assert doubted(0.1, 0.9, still, still) == "the robot does not move in these logs"
    assert doubted(0.1, 0.9, flat) == "the measured torque never changes in these logs"
    assert doubted(0.1, 0.9, still, log()) == ""


def test_physics_says_what_is_impossible_and_how_near_the_nearest_is():
    assert state_physics(Judged()) == "A real robot can have its values."
    signs = state_physics(Judged(feasible=False, infeasible=("a.m", "b.Fv")))
    assert "2 of its values have a sign that physics forbids (a.m" in signs
    assert "The nearest real robot errs by 20 %." in signs
    assert "1 of its values has a sign" in state_physics(Judged(feasible=False, infeasible=("a",)))
    bodies = state_physics(Judged(feasible=False))
    assert "Its values are not physically consistent, although each sign is possible" in bodies
    used = state_physics(Judged(feasible=False, physical_used=True))
    assert "Its values are those to use" in used
    assert "over the robot's range" not in used
    open_ = state_physics(Judged(feasible=False, certificate=None))
    assert "The motion leaves some of its parameters open" in open_
    assert state_physics(Judged(feasible=False, found=None)) == "Not found."
