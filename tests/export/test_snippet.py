"""What a file lacks of a joint's own friction and springs is in MuJoCo by file and snippet."""

import runpy

import mujoco
import numpy as np
import pytest

from identifiability import Robot
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.workflows.export.snippet import OWN, write_snippet
from identifiability.workflows.export.workflow import _reread, write_parameters

from .. import roads
from .conftest import torque_model

#: What no MJCF holds.
LACKING = (
    "Stribeck friction",
    "friction that depends on the position",
    "an unnamed function of velocity",
)


def torque(robot, motion):
    """Return the torque of all that file and sidecar say."""
    every, phi = torque_model(robot)
    return every.regressor(robot, motion) @ phi


@pytest.mark.parametrize("title", OWN)
def test_file_and_snippet_have_the_torque_of_file_and_sidecar(
    title, tmp_path, monkeypatch, two_link
):
    effect = OWN[title]
    names = [p.name for p in effect.parameters(two_link) if p.name.startswith("elbow.")]
    sizes = {name: 0.4 + 0.3 * k for k, name in enumerate(names)}
    values = {**two_link.nominal, **sizes}
    shapes = {"elbow.position_ripple": 0.08} if title == "position ripple" else {}
    written = write_parameters(two_link, values, tmp_path / "fit.xml", shapes=shapes)
    if written.sidecar is None:
        return  # the file holds it
    whole, alone = (
        _reread(two_link, written.robot, written.sidecar, alone=flag) for flag in (False, True)
    )
    path, found = write_snippet(whole, alone, tmp_path / "fit_torque.py")
    if path is None:
        assert title not in LACKING
        return
    assert found == [title]
    add = runpy.run_path(str(path))["add_torque"]
    move = PrescribedMotion.of(shipped_trajectory(two_link, "a"), 300)
    motion = complete_motion(two_link, move.t, move.q, move.dq, move.ddq)
    stated = torque(whole, motion)
    load = roads.load_mujoco

    def load_with(path):
        model = load(path)
        mujoco.set_mjcb_passive(add)
        return model

    file = roads.in_mujoco(written.robot, alone, motion)
    monkeypatch.setattr(roads, "load_mujoco", load_with)
    try:
        both = roads.in_mujoco(written.robot, alone, motion)
    finally:
        mujoco.set_mjcb_passive(None)
    lacks = np.sqrt(np.mean((file - stated) ** 2))
    assert lacks > 0.01
    assert np.sqrt(np.mean((both - stated) ** 2)) < 0.02 * lacks


def test_presliding_is_dry_friction_beyond_its_ways_in_a_plain_file(tmp_path, two_link):
    given = {"elbow.Fc": 0.2, "elbow.H1": 0.1, "elbow.H3": 0.3}
    written = write_parameters(two_link, given, tmp_path / "fit.xml")
    both = Robot.load(written.robot)
    assert {name: both.nominal[name] for name in given} == pytest.approx(given)
    written.sidecar.unlink()
    assert Robot.load(written.robot).nominal["elbow.Fc"] == pytest.approx(0.6)
