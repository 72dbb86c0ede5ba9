"""A motion that is found does not let the robot hit itself, where its file has shapes."""

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from identifiability import Model, excite
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.structure import Structure
from identifiability.workflows.excite import search as candidates
from identifiability.workflows.excite.criteria import know_nothing, pose_question
from identifiability.workflows.excite.limits import CLEARANCE, Clearance, find_limits

INERTIA = '<inertia ixx=".01" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/>'
LINK = '<link name="{}"><inertial><mass value="1"/>' + INERTIA + "</inertial>{}</link>"
LIMIT = '<limit lower="-2.9" upper="2.9" velocity="2" effort="9"/>'
JOINT = (
    '<joint name="j{0}" type="revolute"><parent link="l{1}"/><child link="l{0}"/>'
    '<origin xyz="{2} 0 0"/><axis xyz="0 0 1"/>' + LIMIT + "</joint>"
)
SHAPE = "<collision>{}<geometry>{}</geometry></collision>"
TURNED = '<origin xyz="{} 0 0" rpy="0 1.5707963267948966 0"/>'
LONG, SHORT = (
    SHAPE.format(TURNED.format(x / 2), f'<cylinder radius="0.04" length="{x}"/>')
    for x in (0.4, 0.3)
)
BLOCK = SHAPE.format('<origin xyz="0.15 0 0"/>', '<box size="0.3 0.06 0.06"/>')

MJCF = """
<mujoco model="curling"><compiler angle="radian"/><worldbody><geom type="plane" size="5 5 .1"/>
<body name="l1"><inertial pos=".2 0 0" mass="1" diaginertia=".01 .02 .02"/>
<joint name="j1" axis="0 0 1" range="-2.9 2.9"/>
<geom type="cylinder" fromto="0 0 0 .4 0 0" size=".04"/>
<body name="l2" pos=".4 0 0"><inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/>
<joint name="j2" axis="0 0 1" range="-2.9 2.9"/>
<geom type="cylinder" fromto="0 0 0 .3 0 0" size=".04"/>
<body name="l3" pos=".3 0 0"><inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/>
<joint name="j3" axis="0 0 1" range="-2.9 2.9"/>
<geom type="box" pos=".15 0 0" size=".15 .03 .03"/>
</body></body></body></worldbody>
<actuator><motor joint="j1"/><motor joint="j2"/><motor joint="j3"/></actuator></mujoco>
"""


def urdf(shapes):
    parts = [LINK.format(f"l{k}", shape) for k, shape in enumerate(shapes)]
    parts += [JOINT.format(k, k - 1, at) for k, at in ((1, 0), (2, 0.4), (3, 0.3))]
    return f'<robot name="curling">{"".join(parts)}</robot>'


SHAPES = ["", LONG, SHORT, BLOCK]


@pytest.fixture(params=["urdf", "xml"])
def curling(request, load_text):
    """Return an arm that hits itself where it curls up."""
    return load_text(MJCF if request.param == "xml" else urdf(SHAPES), request.param)


@pytest.fixture
def world():
    """Return a function: does MuJoCo see a contact of the arm with itself?"""
    made = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(made)

    def touches(q):
        data.qpos = q
        mujoco.mj_kinematics(made, data)
        mujoco.mj_collision(made, data)
        pairs = data.contact.geom[: data.ncon]
        return bool(len(pairs) and (pairs.min(1) > 0).any())

    return touches


def test_shapes_touch_where_mujoco_says_so(curling, world):
    watched, why = Clearance.of(curling)
    assert (np.count_nonzero(np.triu(watched.pairs)), why) == (1, "")
    q = default_rng(0).uniform(-2.9, 2.9, (400, 3))
    gaps = watched.gaps(q)
    sure = np.abs(gaps) > 1e-3
    assert_array_equal((gaps < 0)[sure], [world(row) for row in q[sure]])
    assert 20 < (gaps < 0).sum() < 380


def test_nothing_touches_along_what_is_played(curling, world, monkeypatch):
    found = excite(curling, evaluations=2000, seed=1, samples=200)
    assert found.gap >= CLEARANCE
    assert "Bodies that are not joined keep" in found.statement
    assert not any(world(row) for row in found.play(100).q)
    monkeypatch.setattr(candidates.Clearance, "of", staticmethod(lambda _robot: (None, "")))
    careless = [excite(curling, evaluations=1, seed=s, samples=200) for s in range(8)]
    assert any(world(row) for motion in careless for row in motion.motion[1])


def test_the_cost_of_coming_near_has_the_slope_that_it_says(curling):
    question = pose_question(Structure.of(curling, Model.of(*USUAL_EFFECTS)), None, None)
    series = candidates.Series(find_limits(curling), 5.0, 2)
    objective = candidates.Objective(question, know_nothing(question, 60), series, 60)
    draws = series.draw(400, default_rng(2))
    chosen = draws[np.abs(objective.gaps(draws, 60).min(1)).argmin()]
    slope = objective.gradient(chosen)[1]
    size = np.linalg.norm(slope)
    low, high = objective(chosen + 5e-4 * np.array([[-1], [1]]) * slope / size)
    assert (high - low) / 1e-3 == pytest.approx(size, rel=0.1)


def test_where_there_are_no_shapes_that_is_said(load_text, two_link):
    said = excite(two_link, evaluations=1).hints  # its shapes are drawn and do not collide
    assert any("has no shapes that can collide" in text for text in said)
    mesh = '<collision><geometry><mesh filename="away.stl"/></geometry></collision>'
    assert "cannot be read" in Clearance.of(load_text(urdf(["", mesh, "", mesh]), "urdf"))[1]
