"""Structural aliases: what a motion can never name is said before any test."""

from identifiability.logs.prepare import prepare_samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose import Setting, look
from identifiability.workflows.diagnose.problem import know_nothing

HIDDEN = ("coulomb_asymmetry", "torque_offset")


def aliases(robot, logs, *model, effects=None):
    samples = tuple(prepare_samples(robot, log) for log in logs)
    structure = Structure.of(robot, Model.of(*model))
    setting = Setting(structure, samples, know_nothing(structure))
    found = look(setting, effects)
    return {(a.family, a.place): a for a in found.aliases}, found


def test_asymmetry_and_offset_hide_behind_gravity_on_the_3_rps(rps, logs_of):
    found, m = aliases(
        rps, logs_of("3-rps")[:4], "rigid_body", "viscous_friction", "coulomb_friction",
        "actuator_inertia",
        effects=(*HIDDEN, "stribeck_friction", "passive_joint_friction"),
    )  # fmt: skip
    for joint in rps.joints:
        for family in HIDDEN:
            alias = found[family, joint]
            assert alias.structural
            assert alias.remaining < 0.005
            assert any(name.endswith((".m", ".mz", ".mx", ".my")) for name in alias.behind)
        assert found["stribeck_friction", joint].remaining > 0.3
        assert found["passive_joint_friction", joint.replace("slider", "hinge")].remaining > 0.5
    assert not {t.group.family for t in m.before} & set(HIDDEN)


def test_the_rotor_of_the_first_joint_is_its_links_inertia(logs_of):
    robot = Robot.load("six-dof-arm")
    model = ("rigid_body", "viscous_friction", "coulomb_friction")
    found, _ = aliases(robot, logs_of("six-dof-arm")[:2], *model, effects=["actuator_inertia"])
    alias = found["actuator_inertia", "joint_1"]
    assert alias.structural
    assert alias.remaining < 1e-6
    assert alias.behind[0] == "link_1.Izz"
