"""Every variant of a robot file is read as MuJoCo or Pinocchio read it, or refused by name."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Robot

from .mujoco_road import MujocoRoad
from .our_road import nominal_torque, simulated_torque
from .pinocchio_road import PinocchioRoad
from .variants_mjcf import READ, REFUSED
from .variants_urdf import READ as READ_URDF
from .variants_urdf import REFUSED as REFUSED_URDF

AGREE = 1e-9

#: The MuJoCo that knows every attribute of the corpus.
NEWEST = 4000000

MJCF = [make(x) for make, texts in READ.items() for x in texts]
URDF = [make(x) for make, texts in READ_URDF.items() for x in texts]
REFUSALS = [
    (make(x), word)
    for table in (REFUSED, REFUSED_URDF)
    for make, texts in table.items()
    for x, word in texts.items()
]


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A function (text) -> the file; MuJoCo writes its warnings to a file where it runs."""
    monkeypatch.chdir(tmp_path)

    def write(text):
        path = tmp_path / ("robot.urdf" if text.lstrip().startswith("<robot") else "robot.xml")
        path.write_text(text)
        return path

    return write


def too_new(path):
    """Whether an older MuJoCo than the corpus was written for does not know the feature."""
    try:
        return path.suffix == ".xml" and not mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return mujoco.mj_version() < NEWEST


@pytest.mark.parametrize("place, text", list(enumerate([*MJCF, *URDF])))
def test_both_roads_agree(place, text, written, request):
    path = written(text)
    everything = request.config.getoption("--everything")
    if too_new(path):
        return
    spread = 0.3 if "<equality>" in text else 4.0
    road = MujocoRoad(path) if path.suffix == ".xml" else PinocchioRoad(path)
    states = road.states(np.random.default_rng(20), 300 if everything else 5, spread)
    robot = Robot.load(path)
    size = AGREE * np.abs(states.tau).max()
    assert_allclose(nominal_torque(robot, states), states.tau, rtol=0, atol=size)
    # MuJoCo simulates, and it moves no bodies without mass.
    massless = ('mass value="0"', '<link name="fore"></link>')
    if (everything or place % 6 == 0) and not any(x in text for x in massless):
        assert_allclose(simulated_torque(robot, states), states.tau, rtol=0, atol=size)


@pytest.mark.parametrize("text, word", REFUSALS, ids=range(len(REFUSALS)))
def test_what_no_parameter_can_hold_is_refused_by_name(text, word, written, rejected):
    path = written(text)
    if not too_new(path):
        with rejected(f"(?i){word}"):
            Robot.load(path)
