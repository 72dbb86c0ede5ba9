"""Laws of reading MJCF: whatever the file says, both roads have the robot that MuJoCo has."""

import numpy as np
import pytest

from identifiability import simulate
from identifiability.simulation import PrescribedMotion

from .made_robots import arm

TENDON = '<tendon><fixed name="cable" {0}><joint joint="elbow" coef="-0.5"/></fixed></tendon>'
FLOOR = arm().replace("</worldbody>", '<body name="floor"><geom size="1"/></body></worldbody>')

MISSING = """<asset><mesh name="shape" file="none.stl"/>
  <texture name="t" type="2d" file="none.png"/><material name="m" texture="t"/></asset>
  <sensor><jointpos joint="elbow"/></sensor>"""
JET = '<actuator><motor name="jet" site="s"/></actuator>'
REFUSED = {
    "slack tendon": (
        arm(after=TENDON.format('stiffness="1" springlength="0 1"')),
        "'cable' is slack between",
    ),
    "gripper on a tendon": (
        arm(
            after=TENDON.format("").replace("<joint", '<joint joint="shoulder" coef="1"/><joint'),
            actuator='<actuator><position tendon="cable" kp="9"/></actuator>',
        ),
        r"tie them with <equality><joint>, .* the tendon 'cable' moves their sum",
    ),
    "actuator of a site": (
        arm(inside='<site name="s"/>', actuator=JET),
        r"no actuated joint is left .*; name .* in the sidecar",
    ),
}


def test_files_that_no_inertia_needs_may_be_missing(agrees, load_text, rejected):
    shape = '<geom type="mesh" mesh="shape" material="m"/>'
    assert load_text(arm(after=MISSING, inside=shape)).nominal == agrees(arm()).nominal
    with rejected(r"cannot be read by MuJoCo: .*none\.stl"):
        load_text(arm(after=MISSING, inside=f'<body name="tool">{shape}</body>'))


def test_the_hash_knows_meshes_that_weigh_and_no_others(load_text, tmp_path):
    text = arm(
        after='<asset><mesh name="tool" file="tool.obj"/></asset>',
        inside='<body name="tool"><geom type="mesh" mesh="tool"/></body>',
        compiler='meshdir="shapes"',
    )
    stated = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    (tmp_path / "shapes").mkdir()
    hashes = []
    for size in ("0.3", "0.4"):
        corners = f"v 0 0 0\nv {size} 0 0\nv 0 0.2 0\nv 0 0 0.4\n"
        faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        (tmp_path / "shapes" / "tool.obj").write_text(corners + faces)
        hashes += [
            load_text(text).sha256,
            load_text(text.replace("<geom", f"{stated}<geom")).sha256,
        ]
    assert hashes[0] != hashes[2]
    assert hashes[1] == hashes[3]


@pytest.mark.parametrize("feature", REFUSED)
def test_what_no_parameter_can_hold_is_refused_by_name(feature, load_text, rejected):
    text, sentence = REFUSED[feature]
    with rejected(sentence):
        load_text(text)


def test_actuated_joints_of_the_sidecar_stand_for_other_transmissions(load_text):
    text, _ = REFUSED["actuator of a site"]
    robot = load_text(text, sidecar='actuated = ["shoulder", "elbow"]')
    assert robot.joints == ("shoulder", "elbow")


def test_a_hidden_payload_hangs_on_a_body_that_moves(load_text):
    robot = load_text(FLOOR)
    q = np.random.default_rng(0).normal(size=(20, 2))
    move = PrescribedMotion(np.arange(20.0), q, q, q)
    plain, loaded = (simulate(robot, move, hide=h).tau for h in ((), ("payload=0.1",)))
    assert np.std(loaded - plain) == pytest.approx(0.1 * np.std(plain), rel=0.5)
