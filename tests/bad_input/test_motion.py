"""Motion that says little is a result with a reason; motion that cannot be is an error."""

from dataclasses import replace

import numpy as np
import pandas as pd

from identifiability import Log, Robot, analyze, prepare_log, simulate
from identifiability.estimation.verdict import Class
from identifiability.simulation import PrescribedMotion, shipped_trajectory


def table(robot, t, q, tau=0.0):
    """A log of positions alone."""
    columns = {f"{j}.q": q[:, k] for k, j in enumerate(robot.joints)}
    columns |= {f"{j}.tau": tau + np.cos(3 * t + k) for k, j in enumerate(robot.joints)}
    return pd.DataFrame({"t": t, **columns})


def test_a_joint_that_never_moves_is_not_identifiable_and_says_why():
    robot = Robot.load("six-dof-arm")
    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    q, dq, ddq = (np.array(x) for x in (motion.q, motion.dq, motion.ddq))
    q[:, 2], dq[:, 2], ddq[:, 2] = 0.2, 0.0, 0.0
    motion = replace(motion, q=q, dq=dq, ddq=ddq)
    out = analyze(robot, simulate(robot, motion), replicates=20)
    verdicts = {v.name: v for v in out.full.verdicts}
    for name in ("joint_3.Fv", "joint_3.Fc"):
        assert verdicts[name].verdict is Class.NOT_IDENTIFIABLE
        assert verdicts[name].reason == "This motion never makes it act on the torque."
    assert verdicts["joint_2.Fv"].verdict is Class.IDENTIFIABLE
    assert verdicts["joint_6.Fv"].verdict is Class.IDENTIFIABLE
    assert all(v.reason for v in verdicts.values())


def stretched(short_of):
    """Positions that drive the five-bar's distal links into one line, or nearly."""
    t = 0.01 * np.arange(401)
    home = np.array([2.0 * np.pi / 3, np.pi / 3])
    reach = (np.pi / 3 - short_of) * np.sin(np.pi * t / 4) ** 2
    return t, home + reach[:, None] * np.array([1.0, -1.0])


def test_a_motion_near_a_singular_configuration_is_reported_with_its_row():
    robot = Robot.load("five-bar")
    t, q = stretched(3e-4)
    samples = prepare_log(robot, Log.from_frame(table(robot, t, q)))
    note = next(n for n in samples.notes if "near a singular configuration" in n)
    assert samples.motion.condition > 1e3
    row = int(samples.motion.near_singular[0]) + 1
    assert 190 < row <= 201  # the middle of the motion
    assert f"first in data row {row}, condition number up to" in note
    assert "small motion errors become large torque errors there" in note
