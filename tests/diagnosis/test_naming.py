"""Planted truth: what is hidden in the data is named, where it is, and nothing else is."""

from dataclasses import replace
from unittest.mock import Mock

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Noise, analyze, diagnose
from identifiability.effects import find_family
from identifiability.effects.effect import measure_spans
from identifiability.estimation import search
from identifiability.estimation.mixed_model import MixedModel, Term
from identifiability.workflows.diagnose.laws import Laws
from identifiability.workflows.diagnose.naming import Naming

from .conftest import campaign


def find(robot, logs, **options):
    return diagnose(robot, logs[:4], logs[4:], forward=False, **options)


@pytest.mark.parametrize(
    "robot, hidden, joints",
    [
        ("five-bar", "position_ripple@right_shoulder=0.02", ("right_shoulder",)),
        ("two-link", "load_dependent_friction@elbow=0.03", ("elbow",)),
    ],
)
def test_a_hidden_effect_is_named_in_its_joints_and_the_gap_shrinks(
    robot, hidden, joints, diagnosis_of, named
):
    d = diagnosis_of(robot, hidden)
    assert named(d) == [(hidden.partition("@")[0].partition("=")[0], joints)]
    assert d.interval[1] < 0
    assert ", up to " in d.statement
    # What is left is what the same noise leaves when nothing is hidden.
    assert d.held_after < 1.1 * diagnosis_of(robot, effects=("torque_offset",)).held_before


def test_a_tendon_over_two_joints_is_named_over_both(named):
    """MuJoCo alone has it."""
    arm = campaign("two-link")
    joints = '<joint joint="shoulder" coef="1"/><joint joint="elbow" coef="-0.7"/>'
    tendon = f'<tendon><fixed stiffness="3" springlength="0.2">{joints}</fixed></tendon></mujoco>'
    model = mujoco.MjModel.from_xml_string(arm.robot.path.read_text().replace("</mujoco>", tendon))
    data = mujoco.MjData(model)
    torque = np.empty_like(arm.move.q)
    for row, data.qpos[:] in zip(torque, arm.move.q, strict=True):
        mujoco.mj_forward(model, data)
        row[:] = -data.qfrc_spring
    logs = arm.logs(torque, Noise(additive=0.012, correlation=0.9, encoder=2e-5))
    d = find("two-link", logs)
    assert named(d) == [("spring_over_two", ("shoulder~elbow",))]
    assert "Spring over two joints in shoulder–elbow, up to" in d.statement
    assert d.held_after < 0.3 * d.held_before
    assert d.effects[0].placements[0].peak == pytest.approx(np.abs(torque).max(), rel=0.2)


@pytest.mark.parametrize(
    "robot, hidden",
    [
        ("two-link", ["gravity_spring@elbow=0.1", "torque_offset@shoulder=0.05"]),
        (
            "delta",
            ["torque_offset@shoulder1+shoulder2+shoulder3=0.3", "joint_stiffness@shoulder1=1"],
        ),
    ],
)
def test_effects_of_single_joints_are_no_function_of_all_joints_and_the_surer_is_first(
    robot, hidden, diagnosis_of, named
):
    pairs = [text.partition("=")[0].split("@") for text in hidden]
    d = diagnosis_of(robot, *hidden, effects=(*dict(pairs), "position_torque"))
    assert named(d) == [(name, (*joints.split("+"),)) for name, joints in pairs]


def test_both_verbs_name_a_scale_and_one_clock_beside_stronger_friction(
    diagnosis_of, named, logs_of
):
    """Both gain a tenth of what the friction gains, and are no error of its law."""
    friction = "load_dependent_friction@shoulder+elbow=0.1"
    hidden = "scara", friction, "torque_scale@elbow=0.1", "clock_error=0.02"
    names = dict(named(diagnosis_of(*hidden)))
    assert names.pop("clock_error") == ("elbow", "shoulder", "spin")
    assert names == {"load_dependent_friction": ("elbow", "shoulder"), "torque_scale": ("elbow",)}
    found = analyze("scara", logs_of(*hidden), replicates=0)
    assert found.missing.functions == ("load-dependent friction in shoulder and elbow",)
    assert "a wrong scale of the torque in elbow." in found.details
    assert "95 % intervals, if the other gains are right: m2 0.91 ± 0.04" in found.details
    assert "simpler model" not in found.details


FEW = ("torque_offset", "joint_stiffness", "stribeck_friction", "quadratic_friction")


def test_friction_stands_beside_a_curve_and_lends_its_odds_to_no_other_joint(diagnosis_of):
    """A curve along the position does not err along the speed. A law may, and hides friction."""
    friction = "stribeck_friction@elbow=0.1"
    both = diagnosis_of("two-link", "position_torque@elbow=1", friction)
    assert [e.name for e in both.effects] == ["position_torque", "stribeck_friction"]
    hidden = "joint_stiffness@elbow=2", friction, "stribeck_friction@shoulder=0.003"
    (spring,) = diagnosis_of("two-link", *hidden, effects=FEW).effects
    assert spring.name == "joint_stiffness"


def test_torque_of_a_motor_of_two_joints_is_stated_along_the_motor(logs_of):
    nut = np.array([0, 0, 100 * np.pi, 1])
    speeds = [np.gradient(log.q, log.t, axis=0) @ nut for log in logs_of("scara")]
    logs = [
        replace(log, tau=log.tau + (1e-6 * v * abs(v))[:, None] * nut)
        for log, v in zip(logs_of("scara"), speeds, strict=True)
    ]
    (drag,) = find("scara", logs, effects=("quadratic_friction",)).effects
    (at,) = drag.placements
    assert (at.place, at.torque_unit) == ("nut", "N·m")
    assert at.peak == pytest.approx(1e-6 * max(abs(v).max() for v in speeds) ** 2, rel=0.1)


def test_poles_of_a_linear_motor_are_named_with_their_pitch(logs_of):
    pitch = np.ptp([log.q[:, 2] for log in logs_of("scara")[:4]]) / 37.3
    wave = np.array([0, 0, 6.0, 0])
    logs = [
        replace(log, tau=log.tau + np.sin(2 * np.pi / pitch * log.q) * wave)
        for log in logs_of("scara")
    ]
    (ripple,) = find("scara", logs, effects=("position_ripple",)).effects
    assert ripple.placements[0].shape == pytest.approx(pitch, rel=2e-3)
    blind = find("scara", logs, effects=("joint_stiffness",))
    assert "In lift it is 2.4" in blind.unexplained


def test_analyze_says_which_names_explain_as_much(logs_of):
    found = analyze("scara", logs_of("scara", "joint_stiffness@shoulder=0.05"), replicates=0)
    assert " or spring with an unknown rest in " in found.missing.statement


def test_an_effect_whose_values_its_law_excludes_is_not_named(logs_of, monkeypatch):
    values = Naming.values
    monkeypatch.setattr(Naming, "values", lambda *k: (-values(*k)[0], values(*k)[1]))
    logs = logs_of("two-link", "stribeck_friction@elbow=0.1")
    d = find("two-link", logs)
    assert not d.effects
    assert d.held_after == d.held_before


def test_a_name_that_is_far_less_probable_than_another_is_replaced(logs_of, named, monkeypatch):
    def stop_early(model):
        of_elbow = [g for g in model.groups if g.key == ("torque_offset", "elbow")]
        return model.update_terms(tuple(Term(g) for g in of_elbow))

    monkeypatch.setattr(MixedModel, "search", stop_early)
    logs = logs_of("two-link", "gravity_spring@elbow=0.1")
    d = find("two-link", logs)
    assert named(d) == [("gravity_spring", ("elbow",))]
    monkeypatch.setattr(search, "_exchange_improbable", lambda _: ())  # it is not tried
    assert not named(find("two-link", logs))


def test_an_effect_of_another_joint_is_no_other_name(logs_of, named, monkeypatch):
    def stop_early(model):
        return model.update_terms(tuple(Term(g) for g in model.groups if g.key == asked))

    asked = "quadratic_friction", "shoulder"
    monkeypatch.setattr(MixedModel, "search", stop_early)
    logs = logs_of("two-link", "quadratic_friction@shoulder=0.05", "joint_stiffness@elbow=0.5")
    d = find("two-link", logs, effects=("quadratic_friction", "joint_stiffness"))
    assert named(d) == [("quadratic_friction", ("shoulder",))]
    assert not d.effects[0].placements[0].rivals


def test_friction_of_some_passive_joints_keeps_all_in_the_model_and_none_below_zero(diagnosis_of):
    few = ("passive_joint_friction", "torque_offset")
    (found,) = diagnosis_of("3-rps", "passive_joint_friction=0.012", effects=few).effects
    assert {*found.joints} == {"hinge1", "ball1_x", "ball1_y"}
    assert len(found.placements) == 6
    assert min(p.values.min() for p in found.placements) == 0.0


def among(*effects):
    """Run a test with few effects to choose from, and with all of them where there is time."""
    every = pytest.param(None, marks=pytest.mark.everything)
    return pytest.mark.parametrize("effects", [effects, every])


@pytest.mark.everything
@among("torque_leak", "torque_offset", "stribeck_friction", "joint_stiffness", "time_delay")
def test_torque_that_leaks_from_another_joint_is_named(diagnosis_of, named, effects):
    assert "torque_leak" in dict(
        named(diagnosis_of("five-bar", "torque_leak=0.03", effects=effects))
    )


def test_an_effect_that_no_family_fits_is_given_no_name(logs_of):
    """Logs that do not say when they began show that they differ, and not how."""
    logs = [replace(log, start=None) for log in logs_of("five-bar", "thermal_drift=0.012")]
    d = find("five-bar", logs)
    assert d.effects == ()
    assert "No effect stands out" in d.details
    assert "Torque offsets differ between logs" in d.alternative


@pytest.mark.parametrize(
    "rho, motion",
    [
        *(pytest.param(x, 0.0, marks=pytest.mark.everything) for x in (0.0, 0.9, 0.98)),
        (0.9, 0.01),
    ],
)
def test_nulls_get_a_name_no_more_often_than_they_may(rho, motion, logs_of):
    """The whole path from the raw log on; at a rate of .1 more than 2 of 4 happen once in 270."""
    false = 0
    for seed in range(4):
        logs = logs_of("two-link", seed=100 + seed, rho=rho, motion=motion)
        d = diagnose("two-link", logs[:2], logs[4:], seed=seed, forward=False)
        false += bool(d.effects)
    assert false <= 2


@among("coulomb_asymmetry", "torque_offset", "joint_stiffness", "stribeck_friction", "gear_ripple")
def test_coulomb_asymmetry_and_offset_are_one_name_with_two_words(effects, diagnosis_of):
    d = diagnosis_of("six-dof-arm", "coulomb_asymmetry@joint_1=0.03", effects=effects)
    (effect,) = d.effects
    names = {effect.name, *effect.alternatives}
    assert names >= {"coulomb_asymmetry", "torque_offset"}
    # Beside the two only what an offset is the greater part of.
    assert names <= {"coulomb_asymmetry", "torque_offset", "free_spring", "torque_drift"}
    assert effect.joints == ("joint_1",)
    assert "cannot tell" in d.details


def test_friction_of_all_joints_but_one_is_named_in_these_joints_alone(
    diagnosis_of, named, logs_of
):
    """Most joints are not all joints."""
    joints = tuple(f"joint_{k}" for k in range(2, 7))
    hidden = f"stribeck_friction@{'+'.join(joints)}=0.05"
    d = diagnosis_of("six-dof-arm", hidden, effects=FEW)
    assert named(d) == [("stribeck_friction", joints)]
    found = analyze("six-dof-arm", logs_of("six-dof-arm", hidden), replicates=0)
    assert "in joint_2, joint_3, joint_4, joint_5 and joint_6" in found.details


def test_a_law_of_another_form_gets_one_name_and_no_function_beside_it(named, tmp_path):
    """Friction falls with the square of the speed, and differs a little between directions."""
    c = campaign("two-link")
    v = c.move.dq[:, 0]
    added = np.zeros_like(c.move.dq)
    added[:, 0] = 2.0 * (0.1 + np.sign(v)) * np.exp(-((v / (0.3 * v.std())) ** 2))
    noise = Noise(additive=0.004, correlation=0.9, encoder=2e-5)
    logs = c.logs(added, noise, default_rng(0))
    d = find(c.robot, logs)
    assert named(d) == [("stribeck_friction", ("shoulder",))]
    assert d.held_after < 0.3 * d.held_before
    (placed,) = d.effects[0].placements
    assert abs(placed.values[0] - 2.0) < 3 * placed.errors[0] < 0.1
    assert ",2.0" in d.model_text
    (function,) = d.to_dict()["possible"]
    assert "is not used: it gains 150 nats on left-out parts" in d.unexplained
    assert (function["name"], function["place"]) == ("function_of_velocity", "shoulder")
    assert "Effects that may also be present" in d.write_report(tmp_path / "d.html").read_text()


def test_a_shape_that_lies_between_is_found_and_nothing_beside_it(diagnosis_of, named):
    d = diagnosis_of("two-link", "sigmoid_friction@elbow=0.3", seed=1)
    assert named(d) == [("sigmoid_friction", ("elbow",))]
    span = measure_spans(d.robot, [s.motion for s in d.samples])["elbow"]
    grid = np.array(find_family("sigmoid_friction").grid(span))
    true = 0.4 * span.rms_speed
    (placed,) = d.effects[0].placements
    assert abs(placed.shape - true) < 3 * placed.shape_error < np.abs(grid - true).min()
    assert d.tables()[1].rows[0][2].note.startswith("vt = ")


def test_static_friction_is_below_the_largest_torque_of_a_joint_that_moved():
    laws = Laws.of([Mock(shape=1)] * 2, 5.0, *np.array([[[1, 0]], [[9, 3]], [[1, 1]]]))
    assert laws.level[laws.best] < 5


def test_a_tilt_stands_beside_a_cable_and_is_written_for_every_verb(logs_of):
    """A flexible curve of several joints explains more than a tilt, and hides its direction."""
    logs = logs_of("six-dof-arm", "gravity_tilt=0.05")
    scale = logs[0].tau.std(0)
    off = 0.5 * scale * [1, -1, 1, -1, 1, -1]

    def pull(log):
        s = log.q[:, 3] + 0.5 * log.q[:, 4] - 0.2
        cable = (0.7 * s + 0.55 * s**3) * scale[3] / 1.5
        return replace(log, tau=log.tau + off + cable[:, None] * [0, 0, 0, 1, 0.5, 0])

    found = diagnose("six-dof-arm", [*map(pull, logs[:4])], pull(logs[4]), quick=True)
    tilt = found.effects[0]
    assert tilt.name == "gravity_tilt"
    assert tilt.placements[0].values == pytest.approx([0.031, 0.037], abs=0.005)
    assert "What is missing? A tilted base, 2." in found.details
    assert "gravity_tilt@base" in found.to_ladder().models[0].effects
    assert found.physical["gravity"]["degrees"] == pytest.approx(2.7, abs=0.5)
