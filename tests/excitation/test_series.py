"""Whatever a candidate is, its series keeps the joints' limits, between samples too."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot
from identifiability.workflows.excite.limits import Limits, find_limits
from identifiability.workflows.excite.search import Series

LIMITS = Limits(
    ("a", "b"), np.array([-1.0, 0.6]), np.array([2.0, 0.8]), np.array([3.0, 0.16]),
    np.array([9.0, 0.5]), np.full(2, np.inf), np.full(2, np.inf),
)  # fmt: skip


@pytest.mark.parametrize("harmonics", [1, 5])
@pytest.mark.parametrize("level", [1e-3, 1.0, 1e4])
def test_every_candidate_keeps_its_limits_at_every_time(harmonics, level):
    series = Series(LIMITS, 7.5, harmonics)
    x = level * np.random.default_rng(harmonics).standard_normal((20, series.size))
    q, v, a = series.motion(x, 7919)  # far finer than the times at which peaks are looked for
    slack = 1 + 1e-12
    assert np.all(np.abs(q - LIMITS.middle) <= slack * LIMITS.half_range)
    assert np.all(np.abs(v) <= slack * LIMITS.speed)
    assert np.all(np.abs(a) <= slack * LIMITS.acceleration)


def test_limits_come_from_the_robot_and_are_replaced_by_a_file(tmp_path):
    robot = Robot.load("3-rps")
    file = tmp_path / "limits.toml"
    file.write_text('"*2" = {q = [0.65, 0.75], v = 0.1}\n')
    limits = find_limits(robot, file)
    assert_allclose(limits.low, [0.6, 0.65, 0.6])
    assert_allclose(limits.speed, [0.16, 0.1, 0.16])
    assert_allclose(limits.acceleration, 0.5)
    assert not limits.assumed


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("slider4 = {v = 1}", "'slider4' is no actuated joint of the robot, did you mean"),
        ("slider1 = {q = [2, 1]}", "the lower limit must be below the upper one"),
    ],
)
def test_wrong_limits_are_refused_in_one_sentence(tmp_path, text, sentence, rejected):
    file = tmp_path / "limits.toml"
    file.write_text(text)
    with rejected(sentence.replace("[", r"\[")) as error:
        find_limits(Robot.load("3-rps"), file)
    assert "\n" not in str(error.value)


JOINT = """<link name="l{k}"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1"
  ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j{k}" type="revolute">
  <parent link="l{below}"/><child link="l{k}"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1"{more}/></joint>"""


def test_the_speeds_of_a_urdf_are_kept_where_no_sidecar_states_any(load_text):
    """A slow joint is not driven at what is assumed of others; zero and nothing state nothing."""
    speeds = ("0.4", "3", "0", None)
    more = [' effort="9"' + (f' velocity="{v}"' if v else "") for v in speeds]
    joints = [JOINT.format(k=k, below=k - 1, more=m) for k, m in enumerate(more, 1)]
    given = f'<robot name="a"><link name="l0"/>{"".join(joints)}</robot>', "urdf"
    found = find_limits(load_text(*given), {"j2": {"v": 1.5}})
    assert found.speed.tolist() == [0.4, 1.5, 2.0, 2.0]
    assert [a for a in found.assumed if a.endswith(".v")] == ["j3.v", "j4.v"]
    stated = load_text(*given, "[limits]\nj1 = {v = 0.2}\n")
    assert find_limits(stated).speed.tolist() == [0.2, 3.0, 2.0, 2.0]
