"""Every robot file of the corpus is read as MuJoCo or Pinocchio read it, or refused by name."""

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from robot_corpus import ELEMENTS, ENTRIES, SILENT, Entry
from robot_corpus.mujoco_road import MujocoRoad, States
from robot_corpus.our_road import nominal_torque, simulated_torque
from robot_corpus.pinocchio_road import PinocchioRoad

from identifiability.foundation.errors import RobotError
from identifiability.robot import Robot

STATES = 5
AGREE = 1e-9

#: The MuJoCo that knows every attribute of the corpus.
NEWEST = 4000000

#: MuJoCo simulates, and it moves no bodies without mass.
MASSLESS = ("URDF link without inertial", "URDF mass of zero")
READ = [e for e in ENTRIES if not e.refusal and e.name not in MASSLESS]

MARKED = [e for e in ENTRIES if e.marked and not e.unreadable]


def a_third(entries: Sequence[Entry]) -> list:
    """Mark for `make check-all` all but the first and each third of what is of one kind.

    A kind is an element of the file (the first word of a name), and what becomes of the feature.
    """
    met: Counter[tuple[object, ...]] = Counter()
    out = []
    for e in entries:
        kind = (e.urdf, e.name.split()[0], bool(e.refusal), e.unreadable, e.inert)
        out.append(pytest.param(e, marks=pytest.mark.everything if met[kind] % 3 else ()))
        met[kind] += 1
    return out


def states_of(entry: Entry, folder, *, without: bool = False, count: int = STATES) -> States:
    path = entry.write(folder, without=without)
    road = PinocchioRoad(path) if entry.urdf else MujocoRoad(path, strict=not without)
    return road.states(np.random.default_rng(20), count, entry.spread)


def too_new(entry: Entry, path) -> bool:
    """Whether an older MuJoCo than the corpus was written for does not know the feature."""
    try:
        return not entry.urdf and not mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return mujoco.mj_version() < NEWEST


@pytest.mark.parametrize("entry", a_third(ENTRIES), ids=lambda e: e.name)
def test_both_roads_agree_or_the_sentence_names_the_feature(entry, tmp_path):
    path = entry.write(tmp_path)
    try:
        robot = Robot.load(path)
    except RobotError as error:
        sentence = str(error).replace(str(tmp_path), "")
        if not too_new(entry, path):
            assert entry.refusal, f"a supported feature is refused: {sentence}"
            assert entry.refusal in sentence.lower(), sentence
        return
    assert not entry.unreadable, "it cannot be read, but was"
    states = states_of(entry, tmp_path)
    tau = nominal_torque(robot, states)
    np.testing.assert_allclose(tau, states.tau, rtol=0, atol=AGREE * np.abs(states.tau).max())


@pytest.mark.everything
@pytest.mark.parametrize("entry", READ, ids=lambda e: e.name)
def test_both_roads_agree_at_many_states(entry, tmp_path):
    if too_new(entry, entry.write(tmp_path)):
        return
    states = states_of(entry, tmp_path, count=300)
    tau = nominal_torque(Robot.load(entry.write(tmp_path)), states)
    np.testing.assert_allclose(tau, states.tau, rtol=0, atol=AGREE * np.abs(states.tau).max())


@pytest.mark.parametrize(
    "entry",
    [
        pytest.param(e, marks=pytest.mark.everything if k % (8 if e.urdf else 18) else ())
        for k, e in enumerate(READ)
    ],
    ids=lambda e: e.name,
)
def test_the_simulated_robot_is_that_of_the_file(entry, tmp_path):
    if too_new(entry, entry.write(tmp_path)):
        return
    states = states_of(entry, tmp_path, count=20)
    tau = simulated_torque(Robot.load(entry.write(tmp_path)), states)
    np.testing.assert_allclose(tau, states.tau, rtol=0, atol=AGREE * np.abs(states.tau).max())


@pytest.mark.parametrize("entry", a_third(MARKED), ids=lambda e: e.name)
def test_a_feature_changes_the_dynamics_where_the_corpus_says_so(entry, tmp_path):
    """Else an entry would agree by whatever reader."""
    if too_new(entry, entry.write(tmp_path)):
        return
    ours = states_of(entry, tmp_path)
    plain = states_of(entry, tmp_path, without=True)
    same = plain.tau.shape == ours.tau.shape and np.allclose(
        plain.tau, ours.tau, rtol=0, atol=AGREE * np.abs(ours.tau).max()
    )
    assert same == entry.inert


def test_the_corpus_has_each_attribute_of_mjcf_that_can_change_the_dynamics(tmp_path):
    """A new attribute of MuJoCo's fails here until the corpus says what becomes of it."""
    given = _attributes_of_the_corpus(tmp_path)
    known = _attributes_of_mujoco()
    missing = {e: known[e] - given.get(e, set()) - SILENT for e in ELEMENTS}
    assert {e: a for e, a in missing.items() if a} == {}


def test_the_corpus_is_large_and_names_its_entries_once():
    names = [e.name for e in ENTRIES]
    assert len(set(names)) == len(names)
    assert sum(e.urdf for e in ENTRIES) > 40
    assert sum(not e.urdf for e in ENTRIES) > 200
    assert sum(bool(e.refusal) for e in ENTRIES) < len(ENTRIES) / 3


def _attributes_of_the_corpus(folder) -> dict[str, set[str]]:
    out: dict[str, set[str]] = {}
    for entry in ENTRIES:
        if not entry.urdf:
            for element in ET.parse(entry.write(folder)).getroot().iter():
                out.setdefault(element.tag, set()).update(element.attrib)
    return out


def _attributes_of_mujoco() -> dict[str, set[str]]:
    """Return the attributes of each element of MJCF, as this MuJoCo knows them."""
    out: dict[str, set[str]] = {e: set() for e in ELEMENTS}
    element = ""
    for line in mujoco.mj_printSchema(False, False).splitlines():
        head, attributes = line[:29].split(), line[29:].split()
        if head:
            element = head[0].removeprefix("(world)")
        out.setdefault(element, set()).update(attributes)
    return out
