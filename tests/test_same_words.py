"""The same words mean the same from the command line and from Python."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from identifiability import Model, simulate
from identifiability.cli import app
from identifiability.regression.reduction import DEFAULT_EFFECTS as FULL
from identifiability.regression.reduction import USUAL_EFFECTS as USUAL
from identifiability.regression.reduction import build_ladder, default_ladder
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import shipped_trajectory
from identifiability.workflows.diagnose.workflow import usual_effects as diagnose_model


@pytest.fixture(scope="module")
def robot():
    return Robot.load("two-link")


def test_a_seed_from_python_is_the_seed_of_the_command(robot, tmp_path):
    words = ["simulate", "two-link", "a", "--samples", "60", "--noise", "torque=0.1"]
    for seed in ("3", "4"):
        out = str(tmp_path / f"{seed}.csv")
        done = CliRunner().invoke(app, [*words, "--seed", seed, "--out", out])
        assert done.exit_code == 0, done.output
    from identifiability.simulation.motion import PrescribedMotion

    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), 60)
    ours = simulate(robot, motion, noise="torque=0.1", seed=3).to_frame()
    np.testing.assert_allclose(pd.read_csv(tmp_path / "3.csv"), ours, rtol=1e-12)
    assert not np.allclose(pd.read_csv(tmp_path / "4.csv"), ours)


def test_one_ladder_holds_the_models_of_all_verbs(robot):
    """What diagnose and excite take by default is the second model of what analyze judges."""
    first, second = build_ladder(default_ladder(robot), Structure.of(robot, Model.of(*FULL)))
    assert set(first.columns) == set(Structure.of(robot, Model.of(*FULL)).base.names)
    usual = Structure.of(robot, Model.of(*USUAL)).base
    assert set(second.columns) == set(usual.names)
    assert diagnose_model(robot) == USUAL
