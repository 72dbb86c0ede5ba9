"""What torque consists of, against parts that are known one by one."""

import numpy as np

from identifiability import analyze
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, random_trajectory, simulate
from identifiability.workflows.predict import PARTS, torque_budget


def test_parts_are_those_that_were_put_in():
    robot = Robot.load("two-link")
    motion = PrescribedMotion.of(random_trajectory(robot, np.random.default_rng(0)), 600)
    result = analyze(robot, simulate(robot, motion), replicates=100)
    frame = torque_budget(result.fit, result.samples).set_index("joint")
    motion = result.samples[0].motion
    for k, joint in enumerate(robot.joints):
        fv, fc = (robot.nominal[f"{joint}.{kind}"] for kind in ("Fv", "Fc"))
        speed = motion.actuated_v[:, k]
        friction = np.sqrt(np.mean((fv * speed + fc * np.sign(speed)) ** 2))
        assert np.isclose(frame.loc[joint, "friction"], friction, rtol=0.02)
        assert frame.loc[joint, "residual"] < 0.02 * frame.loc[joint, "measured"]
    assert (frame[list(PARTS[:2])] > 0).all().all()
