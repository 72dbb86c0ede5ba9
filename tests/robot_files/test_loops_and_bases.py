"""Laws of loops, couplings, floating bases and balls: the same mechanism, or told with a remedy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability.robot.floating import BASE_JOINTS

from .made_robots import CLOSURES, LINKS, MOTORS, arm, parallelogram


@pytest.mark.parametrize("case", CLOSURES)
def test_a_closure_by_any_site_is_the_same_mechanism(case, agrees):
    sites = '<site name="w" pos="0.6 0 0"/>'
    robot = agrees(parallelogram(CLOSURES[case], sites=sites), spread=0.3)
    assert robot.nominal["heel.K"] == 3.0
    assert robot.nominal["heel.Ia"] == 0.1


@pytest.mark.parametrize("bodies", ['body1="rocker"', 'body1="rocker" body2="base"',
                                    'body1="rocker" body2="world"'])  # fmt: skip
def test_a_closure_by_body_and_anchor_closes_where_the_file_is_drawn(bodies, agrees):
    """MuJoCo takes the second point where the first is in the reference pose: all in line."""
    text = parallelogram(f'<connect {bodies} anchor="-0.4 0 0"/>', base='euler="0 0 0.4"')
    agrees(text, spread=0.3)


def test_a_loop_of_the_sidecar_may_end_in_the_world(load_text):
    text = parallelogram("")
    loop = '[[loops]]\nbody1 = "world"\npoint1 = [0.6, 0, 0]\nbody2 = "rocker"\n'
    assert load_text(text, sidecar=loop + "point2 = [-0.4, 0, 0]").passive == ("knee", "heel")


def test_couplings_follow_each_other_and_inactive_equalities_are_none(agrees):
    text = arm(
        actuator='<actuator><motor joint="shoulder"/></actuator>',
        elbow='ref="0.2"',
        after='<equality><joint joint1="elbow" joint2="shoulder" polycoef="0.1 -2 0.3 0.1 0"/>'
        '<weld body1="link2" active="false"/></equality>',
    )
    robot = agrees(text)
    assert robot.passive == ("elbow",)
    x = np.linspace(-1, 1, 5)  # MuJoCo counts from where joints are drawn
    expected = 0.2 + 0.1 - 2 * x + 0.3 * x**2 + 0.1 * x**3
    assert_allclose(np.polyval(robot.couplings[0].polynomial[::-1], x), expected)
    off = text.replace("<worldbody>", '<option><flag equality="disable"/></option><worldbody>')
    assert agrees(off.replace("</actuator>", '<motor joint="elbow"/></actuator>')).loops == ()


def test_a_loop_that_is_open_at_home_is_told_with_positions_that_close_it(load_text, rejected):
    closure = CLOSURES["site on the root"]
    with rejected(r"open by 0\.\d+ m at the home .* such as knee = ") as told:
        load_text(parallelogram(closure, home="0.7 0.3"))
    knee, heel = (float(str(told.value).split(f"{j} = ")[1][:7].rstrip(",. ")) for j in
                  ("knee", "heel"))  # fmt: skip
    robot = load_text(parallelogram(closure, home=f"0.7 {knee}").replace(' 0.7"', f' {heel}"'))
    assert np.isclose(robot.home[1], knee)
    assert load_text(parallelogram(closure, home="0.703 -0.70")).passive == ("knee", "heel")


FLOATING = arm(
    worldbody=LINKS.replace("{base}>", '{base}><freejoint name="root"/><geom size="1"/>')
)
BALL = arm(worldbody=LINKS.replace('<joint name="elbow" axis="0 -1 0" {elbow}/>',
                                   '<joint name="elbow" type="ball"/>'))  # fmt: skip


def test_a_base_on_a_free_joint_floats_on_six_that_stand_for_it(load_text, rejected):
    robot = load_text(FLOATING)
    assert robot.joints == (*BASE_JOINTS, *robot.motor_joints)
    assert robot.base.title == "root"
    assert load_text(FLOATING.replace('<freejoint name="root"/>', "")).joints == robot.motor_joints
    with rejected("the free joint 'root' cannot be actuated"):
        load_text(FLOATING.replace("</actuator>", '<motor joint="root"/></actuator>'))


def test_a_floating_robot_with_loops_of_its_own_floats_and_a_free_platform_lacks_closures(
    load_text, rejected
):
    legged = parallelogram(CLOSURES["site on the root"], home="0 0 1 1 0 0 0 0.7 -0.7")
    legged = legged.replace("<site name", '<freejoint name="root"/><geom size="1"/><site name', 1)
    robot = load_text(legged)
    assert robot.joints == (*BASE_JOINTS, "drive")
    assert robot.passive == ("knee", "heel")
    plate = '<body name="plate"><freejoint name="f"/><geom size="1"/><site name="p"/></body>'
    tie = '<connect body1="plate" body2="crank" anchor="0 0 0"/>'
    text = parallelogram(CLOSURES["site on the root"] + tie, home="0 0 0 1 0 0 0 0.7 -0.7").replace(
        "<worldbody>", f"<worldbody>{plate}"
    )
    with rejected(
        r"Ball and floating joints \(f\) can only be passive in a closed loop",
    ):
        load_text(text)
    # Tied to nothing that a motor moves it is an object beside the robot.
    assert load_text(text.replace(tie, "")).outside == ("plate",)


@pytest.mark.parametrize("actuator", [MOTORS, "", '<actuator><motor joint="shoulder"/></actuator>'])
def test_a_ball_joint_is_told_and_the_advice_helps(actuator, load_text, rejected):
    text = BALL.replace(MOTORS, actuator)
    with rejected(r"elbow.* three hinges in one body"):
        load_text(text)
    hinges = [f'<joint name="elbow_{a}" axis="{x}"/>'
              for a, x in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)]  # fmt: skip
    motors = "".join(f'<motor joint="elbow_{a}"/>' for a in "xyz")
    text = text.replace('<joint name="elbow" type="ball"/>', "".join(hinges))
    every = f'<actuator><motor joint="shoulder"/>{motors}</actuator>'
    text = text.replace(actuator, every) if actuator else text
    assert load_text(text).joints == ("shoulder", "elbow_x", "elbow_y", "elbow_z")


def test_friction_of_a_ball_is_refused(load_text, rejected):
    text = BALL.replace('type="ball"', 'type="ball" damping="1"')
    with rejected("'elbow' has damping, and is a ball"):
        load_text(text)
