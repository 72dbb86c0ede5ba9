"""An exported pair is a robot like any other: the same logs say of it what they said before."""

import numpy as np
import pytest

from identifiability import analyze, simulate
from identifiability.effects.registry import default_effects
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.robot import Robot
from identifiability.robot.locate import shipped_robots
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory
from identifiability.workflows.export import export

BASIC = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
SAMPLE = ("two-link", "five-bar", "differential-wrist")


def make_log(robot, trajectory, seed):
    motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 200)
    noise = Noise(torque=0.02)
    return simulate(robot, motion, noise=noise, rng=np.random.default_rng(seed))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=() if n in SAMPLE else pytest.mark.everything)
        for n in shipped_robots()
        if n
        not in ("cart-arm", "free-body", "walking-quadruped")  # they float, and are not simulated
    ],
)
def test_the_same_logs_say_the_same_of_what_was_exported(name, tmp_path):
    robot = Robot.load(name)
    motions = ("601", "595") if name == "3-rps" else "ab"
    logs = [make_log(robot, motion, k) for k, motion in enumerate(motions)]
    effects = [*default_effects(robot, BASIC)]
    entry = LadderEntry(models=[ModelEntry(name="full", effects=effects)])
    before = analyze(robot, logs[0], logs[1], ladder=entry, replicates=20)
    path = before.to_json(tmp_path / "result.json")
    exported = export(robot, path, tmp_path / f"fitted{robot.path.suffix}")
    copy = Robot.load(exported.robot)
    for parameter, value in before.to_dict()["physical"]["parameters"].items():
        assert copy.nominal.get(parameter, 0.0) == pytest.approx(value, rel=1e-9, abs=1e-12)
    after = analyze(copy, logs[0], logs[1], ladder=entry, replicates=20)
    assert after.base.names == before.base.names
    value = before.chosen.estimate.value
    np.testing.assert_allclose(after.chosen.estimate.value, value, rtol=1e-6, atol=1e-9)
    said = [[v.verdict for v in r.chosen.verdicts] for r in (before, after)]
    assert said[0] == said[1]
    assert after.chosen.unseen_by(0) == pytest.approx(before.chosen.unseen_by(0), rel=1e-9)
    assert after.chosen.unseen_by(1) == pytest.approx(before.chosen.unseen_by(1), rel=0.05)
