"""`simulate` refuses motions, effects and noise that cannot be, and writes nothing then."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from identifiability.robot.locate import locate_robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.simulation.motion import find_motion

JOINTS = ("slider1", "slider2", "slider3")


@pytest.fixture
def simulates(refused, write):
    """A function (robot, motion, options) -> the sentence; the old log stays."""
    return lambda robot, motion, *options: refused(
        "simulate", robot, motion, "--out", write("old.csv", "old"), *options
    )


@pytest.mark.parametrize(
    "robot, motion, sentence",
    [
        ("3-rps", "600", "'600' for 3-rps, did you mean '601'? It has 571, 595, 601; 'random'"),
        ("two-link", "no.json", "There is no trajectory file 'no.json'"),
    ],
)
def test_unknown_motion_is_refused(robot, motion, sentence, simulates):
    assert sentence in simulates(robot, motion)


@pytest.mark.parametrize(
    "option, value, sentence",
    [
        ("--hide", "stribek_friction", "cannot be hidden, did you mean 'stribeck_friction'?"),
        ("--hide", "stribeck_friction=-1", "give its share of the joint's torque"),
        ("--noise", "motoin=0.1", "no noise or level 'motoin', did you mean 'motion'?"),
        ("--noise", "correlation=1", "correlation must be .* and below 1, not 1.0"),
    ],
)
def test_unknown_effects_and_noise_are_refused(option, value, sentence, simulates):
    said = simulates("two-link", "a", option, value)
    assert all(part in said for part in sentence.split(" .* "))


def motion_of(q, step=0.01):
    t = step * np.arange(len(q))
    return pd.DataFrame({"t": t, **{f"{j}.q": q[:, k] for k, j in enumerate(JOINTS)}})


SWING = np.sin(0.03 * np.arange(200))[:, None] * np.array([1.0, -1.0, 0.5])


@pytest.mark.parametrize(
    "q, sentence",
    [
        (0.7 + 1.5 * SWING, "MuJoCo cannot close the loops of 3-rps at sample "),
        (1000 * (0.7 + 0.02 * SWING), "it looks like mm: convert it to m."),
    ],
)
def test_motion_outside_the_workspace_is_refused(q, sentence, simulates, write):
    assert sentence in simulates("3-rps", write("motion.csv", motion_of(q)))


def edited(**changes):
    content = json.loads(locate_robot("two-link").with_name("trajectories.json").read_text())
    entry = content["trajectories"]["a"]
    entry |= {k: entry["elbow"] | v for k, v in changes.pop("joints", {}).items()}
    for name in changes.pop("lost", ()):
        del entry[name]
    return json.dumps(content | changes)


@pytest.mark.parametrize(
    "content, sentence",
    [
        ("{", "is not valid JSON: Expecting property name"),
        (edited(period=1e308), "'period': input should be less than or equal to"),
        (edited(lost=["elbow"]), "trajectory 'a' has no entry for elbow."),
        (edited(joints={"elbow": {"sin": [1.0]}}), "has joints with different harmonics"),
    ],
)
def test_a_bad_trajectory_file_is_refused(content, sentence, simulates, write):
    assert sentence in simulates("two-link", write("motion.json", content))


def test_lost_samples_that_a_fit_bridges_are_bridged_in_a_motion(tmp_path, rng, two_link, rejected):
    """Rows that are missing for less than half a period of the cut-off change no motion."""
    motion = PrescribedMotion.of(shipped_trajectory(two_link, "a"), 750)
    frame = pd.DataFrame({"t": motion.t} | {f"{j}.q": motion.q[:, k] for k, j in
                                            enumerate(two_link.joints)})  # fmt: skip
    whole, lost, torn = (tmp_path / f"{name}.csv" for name in ("whole", "lost", "torn"))
    frame.to_csv(whole, index=False)
    frame.drop(index=[100, 101, 300, 400, 401, 402]).to_csv(lost, index=False)
    frame.drop(index=range(100, 400)).to_csv(torn, index=False)
    first, again = (find_motion(two_link, str(p), None, rng) for p in (whole, lost))
    assert len(again.t) == len(first.t)
    assert_allclose(again.t, first.t, atol=1e-6)
    assert_allclose(again.ddq, first.ddq, atol=0.02 * np.abs(first.ddq).max())
    with rejected(r"has a gap of .* s after t"):
        find_motion(two_link, str(torn), None, rng)
