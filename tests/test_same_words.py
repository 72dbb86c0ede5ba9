"""The same words mean the same from the command line and from Python."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from identifiability import analyze, prune, simulate
from identifiability.cli import app
from identifiability.robot import Robot
from identifiability.simulation import shipped_trajectory


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


def test_quick_is_a_tenth_unless_somebody_says_how_many(robot):
    log = simulate(robot, shipped_trajectory(robot, "a"), noise="torque=0.02")
    assert analyze(robot, log, quick=True).settings["replicates"] == 200
    assert analyze(robot, log, quick=True, replicates=2).settings["replicates"] == 2
    assert prune(robot, log, quick=True).settings["replicates"] == 20
