"""MuJoCo and Pinocchio find in an exported file the errors that were stated for it."""

import re

import pytest

from identifiability import Model, Robot, analyze, find_base_parameters, prune
from identifiability.effects import FAMILIES
from identifiability.foundation.findings import phrase
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.simulation import PAPER_NOISE
from identifiability.workflows.export import draw_robots

from ..conftest import shipped_log
from .conftest import replay

BASIC = ["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia"]
ROBOTS = ("two-link", "five-bar", "3-rps", "six-dof-arm", "six-ups")
HIDDEN = (
    "coulomb_asymmetry", "torque_offset", "stribeck_friction", "load_dependent_friction",
    "quadratic_friction", "joint_stiffness", "payload", "gravity_tilt", "position_ripple",
    "time_delay", "passive_joint_friction", "free_spring",
)  # fmt: skip
SERIAL = ("two-link", "six-dof-arm")
CASES = [
    (robot, what)
    for robot in ROBOTS
    for what in ("full", "zeroed", "pruned", *HIDDEN)
    if what != "passive_joint_friction" or robot not in SERIAL
]
SAMPLE = {
    ("two-link", "full"), ("two-link", "pruned"), ("five-bar", "zeroed"),
    ("two-link", "load_dependent_friction"), ("two-link", "payload"), ("five-bar", "time_delay"),
    ("two-link", "joint_stiffness"), ("five-bar", "passive_joint_friction"),
    ("two-link", "gravity_tilt"), ("two-link", "position_ripple"), ("five-bar", "free_spring"),
}  # fmt: skip
#: Errors are stated with less than this of themselves between engines: rounding, not 1 %.
ROUNDING = 1e-4


def fit(name, what):
    """A noisy log with an effect that the robot file lacks, and its fit with that effect."""
    robot = Robot.load(name)
    motion = "601" if name == "3-rps" else "a"
    family = what.partition("@")[0]
    hide = [f"{family}=0.2"] if family in HIDDEN else []
    gone = ("Fv", "Fc", "Fc+", "Fc-", *robot.inertia_parts) if what == "zeroed" else ()
    bare = {n: 0.0 for n in robot.nominal if n.rpartition(".")[2] in gone}
    log = shipped_log(robot, motion, 250, noise=PAPER_NOISE, hide=hide, parameters=bare, seed=3)
    effects = [*BASIC, what] if hide else BASIC
    if what == "pruned":
        start = LadderEntry(models=[ModelEntry(name="full", effects=BASIC)])
        return prune(robot, log, ladder=start, replicates=2), log
    zero = []
    if what == "zeroed":
        base = find_base_parameters(robot, Model.of(*BASIC))
        zero = [n for n in base.names if n.rpartition(".")[2] in gone]
    ladder = LadderEntry(models=[ModelEntry(name="fitted", effects=effects, zero=zero)])
    result = analyze(robot, log, ladder=ladder, replicates=0)
    assert result.chosen.name == "fitted"
    return result, log


@pytest.mark.parametrize(
    "name, what",
    [pytest.param(*c, marks=() if c in SAMPLE else pytest.mark.everything) for c in CASES],
)
def test_other_engines_find_the_stated_errors(name, what, tmp_path):
    robot = Robot.load(name)
    result, log = fit(name, what)
    found = replay(robot, result, log, tmp_path)
    assert found.mujoco == pytest.approx(found.stated["error_ra_file"], rel=ROUNDING)
    if what not in ("joint_stiffness", "free_spring"):  # Pinocchio knows no springs
        assert found.pinocchio == pytest.approx(found.stated["error_ra_file"], rel=ROUNDING)
    assert found.whole == pytest.approx(found.stated["error_ra"], rel=ROUNDING)
    if what == "zeroed":
        for joint in robot.joints:
            kinds = ("Fv", "Fc", "Fc+", "Fc-")
            assert not any(found.robot.nominal[f"{joint}.{kind}"] for kind in kinds)


def test_an_effect_with_a_shape_comes_back_and_its_torque_is_said_with_one_article(tmp_path):
    result, log = fit("two-link", "stribeck_friction@*:0.4,2")
    found = replay(result.robot, result, log, tmp_path)
    assert found.whole == pytest.approx(found.stated["error_ra"], rel=ROUNDING)
    parameters = result.to_dict()["physical"]["parameters"]
    assert found.robot.nominal["elbow.Fs"] == parameters["elbow.Fs"] > 0
    (file,) = draw_robots(result.robot, result.fit, 1).write(tmp_path / "drawn.xml")
    assert "Each drawn file cannot hold Stribeck friction (shoulder.Fs, elbow" in file.read_text()
    shapes = Robot.load(file).shapes
    assert shapes == found.robot.shapes
    assert {*shapes.values()} == {0.4, 2.0}
    assert (
        "friction (shoulder.Fs, elbow.Fs), up to 7.98 N·m in shoulder" in found.exported.statement
    )
    for family in FAMILIES.values():
        said = phrase("exported", "in_sidecar", file="a", effects=[family.title], peak="")
        assert not re.search(r"\b(no|an?|the) (an?|the)\b", said)
