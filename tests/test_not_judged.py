"""Logs that are too short, or filtered too low, for any verdict: every output says so."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, simulate
from identifiability.estimation.verdict import Class
from identifiability.simulation import random_trajectory

from .marks import everything


@pytest.mark.parametrize("size", [everything(0.0), 1e-3])
def test_nearly_noise_free_logs_are_judged_and_right(size):
    """What differences leave of an exact log once looked like slow noise, of few outputs."""
    robot = Robot.load("six-dof-arm")
    rng = np.random.default_rng(0)
    motion = random_trajectory(robot, rng, samples=2300, period=23.0)
    log = simulate(robot, motion, noise=Noise(additive=size), rng=rng).rows(0, 1500)
    found = analyze(robot, replace(log, dq=None, ddq=None), replicates=20)
    full = found.full
    assert full.unjudged == ""
    stated = found.structure.nominal_base - full.submodel.fixed
    truth = np.linalg.lstsq(full.submodel.M, stated, rcond=None)[0]
    known = [
        (v.interval95[0] <= true <= v.interval95[1])
        for v, true in zip(full.verdicts, truth, strict=True)
        if v.verdict is Class.IDENTIFIABLE
    ]
    assert len(known) > 30
    assert np.mean(known) >= 0.93
