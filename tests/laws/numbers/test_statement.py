"""A model that predicts no better than a constant torque answers nothing."""

from dataclasses import dataclass, replace

import pytest

from identifiability.workflows.analyze.result import doubt


@dataclass
class Judged:
    """What is asked of a model before it may answer."""

    error_ra_validation: float
    constant: float
    withdrawn: str = ""

    @property
    def unseen(self):
        return self

    def constant_error(self):
        return self.constant

    def withdraw(self, why):
        return replace(self, withdrawn=why)


@pytest.mark.parametrize(
    ("error", "constant", "worse"),
    [(0.1, 0.11, False), (0.1, 0.1, True), (0.1, float("nan"), True), (float("nan"), 0.1, True)],
)
def test_the_selected_model_must_be_better_than_a_constant_torque(error, constant, worse):
    results, why = doubt("", (Judged(error, constant), Judged(0.01, constant)), 0)
    assert [r.withdrawn for r in results] == [why, why]
    assert (why == "") == (not worse)
    assert ("better than a constant torque would" in why) == worse
