"""The same words mean the same from the command line and from Python."""

from __future__ import annotations

import pytest

from identifiability import Model, Robot
from identifiability.regression.reduction import DEFAULT_EFFECTS as FULL
from identifiability.regression.reduction import USUAL_EFFECTS as USUAL
from identifiability.regression.reduction import build_ladder, default_ladder
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.workflow import usual_effects as diagnose_model


@pytest.fixture(scope="module")
def robot():
    return Robot.load("two-link")


def test_one_ladder_holds_the_models_of_all_verbs(robot):
    """What diagnose and excite take by default is the second model of what analyze judges."""
    first, second = build_ladder(default_ladder(robot), Structure.of(robot, Model.of(*FULL)))
    assert set(first.columns) == set(Structure.of(robot, Model.of(*FULL)).base.names)
    usual = Structure.of(robot, Model.of(*USUAL)).base
    assert set(second.columns) == set(usual.names)
    assert diagnose_model(robot) == USUAL
