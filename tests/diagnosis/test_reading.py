"""Under a wrong model everything seems to be missing: other ones of the same torque come first."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import (
    Model,
    Noise,
    Robot,
    analyze,
    diagnose,
    export,
    prepare_log,
    prune,
    simulate,
)
from identifiability.effects.base import horizontal_axes
from identifiability.estimation.prediction import allow_offsets
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.quality import MeasuredLogs
from identifiability.reading import choose_reading
from identifiability.reading.fit import TorqueRows
from identifiability.reading.reading import Reading
from identifiability.reading.verification import Verification
from identifiability.regression.regression import LogPart
from identifiability.regression.structure import Structure
from identifiability.robot.description import Tilt
from identifiability.robot.kinematics import turn
from identifiability.robot.robot import tool_bodies
from identifiability.simulation import Campaign, random_trajectory
from identifiability.workflows import case

from ..roads import weight

MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def scaled(robot, share, start=""):
    return {n: share * x for n, x in robot.nominal.items() if n.startswith(start)}


def record(name, seed=1, masses=1.0, samples=600, payload=0.0, **noise):
    """Return a robot, and a log of one whose masses are so many times the file's."""
    robot, rng = Robot.load(name), default_rng(seed)
    bodies = {n: masses * x for n, x in robot.nominal.items() if n.split(".")[0] in robot.bodies}
    truth = robot.with_values(bodies)
    if payload:
        body = tool_bodies(robot)[0]
        truth = truth.with_payload(mass=payload, centre=(0.3, 0.0, 0.1), body=body)
    noise = Noise(**{"additive": 0.02, "correlation": 0.9, "encoder": 1e-5, **noise})
    return robot, simulate(
        truth, random_trajectory(truth, rng, samples=samples), noise=noise, rng=rng
    )


def known(robot, *logs):
    how = choose_cutoff(robot, logs, None)
    samples = tuple(prepare_log(robot, log, how) for log in logs)
    return MeasuredLogs(Structure.of(robot, MODEL), logs, samples)


def look(robot, *logs):
    return choose_reading(known(robot, *logs))


def one(joint, value, n=6):
    return np.where(np.arange(n) == joint, value, 1.0)


def otherwise_stated(robot, gravity):
    """Return a robot whose file states another gravity."""
    model = robot.model.copy()
    model.gravity.linear = gravity
    return replace(robot, model=model)


@pytest.fixture(scope="module")
def arm():
    return record("six-dof-arm")


@pytest.mark.parametrize(
    "joint, factor, says",
    [(3, 1e-3, "is 0.00"), (5, 20.0, "is ")],
)
def test_a_torque_of_another_unit_is_found(arm, joint, factor, says):
    robot, log = arm
    wrong = replace(log, tau=one(joint, factor) * log.tau)
    found = look(robot, wrong)
    assert found.description.startswith(f"The torque of {log.joints[joint]} {says}")
    given = Structure.of(robot, MODEL)
    assert_allclose(found.read(wrong, given).tau, log.tau, rtol=0.3)
    assert found.structure(given) is given
    assert not found.keeps_columns


def test_all_wrong_signs_are_named_at_once_and_stated_ones_too(arm):
    robot, log = arm
    torque = robot.torque.model_copy(update={"sign": {"joint_2": -1, "joint_5": -1}})
    found = look(replace(robot, torque=torque), replace(log, tau=log.tau * [1, -1, 1, -1, 1, 1]))
    assert np.flatnonzero(found.factor < 0).tolist() == [1, 3]
    assert "joint_2 and joint_4 seems to have the wrong sign" in found.description
    assert "states sign = -1 for joint_2, and the logs" in found.description
    assert "say sign = {joint_4 = -1, joint_5 = -1} under [torque]" in found.remedy


@pytest.mark.parametrize(
    "factor, text",
    [(-1.0, "wrong sign"), (180 / np.pi, "degrees")],
)
def test_positions_that_are_read_otherwise_are_found(arm, factor, text):
    robot, log = arm
    moved = one(1, factor) * log.q
    wrong = replace(log, q=moved, dq=None, ddq=None)
    found = look(robot, wrong)
    assert "joint_2" in found.description
    assert text in found.description
    assert_allclose(found.read(wrong, Structure.of(robot, MODEL)).q, log.q, atol=0.01)


def test_offsets_that_differ_between_logs_are_found_and_taken_out(arm):
    robot, _ = arm
    logs = [record("six-dof-arm", seed=k)[1] for k in (1, 2, 3)]
    offsets = default_rng(1).normal(0, 0.1, (3, 6)) * logs[0].tau.std(0)
    named = zip("abc", logs, offsets, strict=True)
    given = [replace(x, name=name, tau=x.tau + by) for name, x, by in named]
    found = look(robot, *given)
    assert found.description.startswith("Torque offsets differ between logs")
    apart = np.array([found.offsets[name] for name in "abc"])
    assert (np.abs(apart - offsets + offsets.mean(0)) < 0.03 * logs[0].tau.std(0)).all()
    read = found.read(given[0], Structure.of(robot, MODEL))
    assert_allclose(read.tau, given[0].tau - apart[0])
    assert look(robot, *logs) is None


def test_a_load_of_one_log_is_no_offset_that_differs():
    robot, log = record("3-rps", seed=2, payload=20.0)
    others = [record("3-rps", seed=k)[1] for k in (1, 3)]
    found = look(robot, replace(log, name="loaded"), *others)
    assert not found.holds
    assert found.load.startswith("loaded seems to carry 20.")


def test_a_load_whose_mass_no_motion_shows_is_stated_without_it(tmp_path):
    """A body that turns about one axis shows its moment, and not its mass."""
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j" axis="0 1 0"/><inertial pos="0.2 0 0" '
        'mass="2" diaginertia="0.02 0.02 0.02"/></body></worldbody>'
        '<actuator><motor joint="j"/></actuator></mujoco>'
    )
    logs = [record(path, seed=k, payload=p)[1] for k, p in ((1, 0.0), (2, 1.0))]
    assert "another load at arm than" in look(Robot.load(path), *logs).load


@pytest.mark.parametrize("name, masses", [("two-link", 1.0), ("six-dof-arm", 3.0)])
def test_effort_without_weight_is_found_whatever_masses_the_file_has(name, masses):
    robot, log = record(name, masses=masses)
    truth = robot.with_values(scaled(robot, masses))
    found = look(robot, replace(log, tau=log.tau - weight(truth, log)))
    assert not found.gravity.any()
    assert not found.structure(Structure.of(robot, MODEL)).robot.gravity.any()


def test_the_weight_of_a_payload_is_found_in_effort_without_that_of_the_robot(tmp_path):
    robot, log = record("two-link", payload=1.5)
    found = analyze(robot, replace(log, tau=log.tau - weight(robot, log)), "none", replicates=0)
    assert "but not of its payload" in found.hints[0]
    mass = found.to_frame().set_index("name").loc["link2.weight_m"]
    assert mass.lower <= 1.5 <= mass.upper <= mass.lower + 0.3
    assert "link2.weight_m" in export(robot, found, tmp_path / "out.xml", force=True).statement


def test_a_tool_that_the_file_lacks_is_asked_for_and_a_wrong_mass_is_that_of_its_link():
    robot, log = record("six-dof-arm", payload=1.0)
    light = scaled(robot, 0.15, "link_6.")
    (said,) = analyze(robot.with_values(light), log, "none", replicates=0).warnings
    assert "link_6 has another mass, centre or inertia" in said
    assert "link_5.mx (combined with link_6.mx and 1 more parameter) = 0.105 kg·m in" in said
    assert "Does link_6 carry a tool or load that the file lacks?" in said
    robot, log = record("six-dof-arm")
    wrong = scaled(robot, 1.3, "link_3.")
    (said,) = analyze(robot.with_values(wrong), log, "none", replicates=0).warnings
    assert "link_3 is 22 % (± 2 %) lighter than stated" in said
    assert "buoyancy" in said
    heavy = simulate(
        robot.with_values(wrong), random_trajectory(robot, default_rng(1), samples=600)
    )
    (said,) = analyze(
        robot, replace(log, tau=6 * log.tau - 5 * heavy.tau), "none", replicates=0
    ).warnings
    assert "link_3 would need a mass below zero" in said
    assert "link_3 has" not in said


def test_the_late_clock_of_one_log_is_found():
    (robot, log), (_, other) = (record("six-dof-arm", seed=seed) for seed in (1, 2))
    found = look(robot, log, replace(other, tau=np.roll(other.tau, 1, axis=0), name="late"))
    assert found.late == "late"
    assert_allclose(found.delay, other.t[1], rtol=0.1)
    assert look(robot, log, replace(other, name="late")) is None
    both = (replace(x, tau=np.roll(x.tau, 1, axis=0), name=str(x.q[0])) for x in (log, other))
    assert not look(robot, *both).late


def test_a_torque_offset_that_the_model_lacks_blames_no_body(arm):
    robot, log = arm
    log = replace(log, tau=log.tau + 20.0 * np.eye(6)[1])
    found = diagnose(robot, log, model=MODEL, effects=["hysteresis"], forward=False)
    assert not any("than stated" in said for said in found.warnings)


def test_a_spring_that_acts_as_a_body_in_any_motion_is_told_with_that_body(logs_of, tmp_path):
    logs = logs_of("two-link", "gravity_spring@shoulder=0.5")
    found = analyze("two-link", logs[:2], logs[2:3], replicates=0)
    (said,) = found.warnings
    assert "shoulder has a spring or counterweight or link1 has another mass" in said
    assert "σ" not in said
    row = found.to_frame().set_index("name").loc["link1.mx"]
    assert row.verdict == "sign only"
    assert row.lower < 2.05 < row.upper
    made = export("two-link", found, tmp_path / "r.xml")
    assert "act as these values do: link1.mx" in made.robot.read_text()
    one = diagnose("two-link", logs[:3], effects=["hysteresis"], forward=False)
    assert "counterweight in shoulder may" in one.statement


def test_a_torque_offset_that_the_logs_allow_moves_values_as_far_as_its_parameter_widens_them():
    found = analyze(*record("two-link", correlation=0.0), "none", replicates=0)
    full, bare = found.models
    allowed = allow_offsets(bare.submodel.reduce(found.information), bare.estimate)
    wide = np.hypot(bare.estimate.sigma, np.linalg.norm(allowed, axis=1))
    at = [full.submodel.columns.index(name) for name in bare.submodel.columns]
    assert_allclose(wide, full.estimate.sigma[at], rtol=0.05)


def test_a_zero_of_the_first_encoder_is_named_with_the_tilt_that_acts_as_it_does():
    robot, log = record("two-link")
    found = look(robot, replace(log, q=log.q + np.array([0.4, 0.0])))
    assert found.turned
    says = re.search(r"positions of shoulder are (\S+) rad too large", found.description)
    assert float(says[1]) == pytest.approx(0.4, abs=0.02)


def test_weight_that_one_joint_lacks_is_found_and_the_fitted_robot_s_is_added():
    robot, log = record("six-dof-arm", masses=1.3)
    truth = robot.with_values(scaled(robot, 1.3))
    light = replace(log, tau=log.tau - (np.arange(6) == 1) * weight(truth, log))
    found = look(robot, light)
    assert np.flatnonzero(found.compensated).tolist() == [1]
    assert 'Say compensated = ["joint_2"]' in found.remedy
    added = found.read(light, Structure.of(robot, MODEL)).tau - light.tau
    missed, file = added - weight(truth, log), weight(robot, log) - weight(truth, log)
    assert np.linalg.norm(missed[:, 1]) < 0.2 * np.linalg.norm(file[:, 1])


def delay(log, seconds):
    """Return a log with positions alone, whose torque is late by (n,) [s]."""
    pairs = zip(seconds, log.tau.T, strict=True)
    tau = np.stack([np.interp(log.t - by, log.t, x) for by, x in pairs], 1)
    return replace(log, dq=None, ddq=None, tau=tau)


@pytest.mark.parametrize("joint, seconds", [(4, -0.04), (2, 0.13)])
def test_a_late_torque_is_found_to_a_third_of_a_sample(arm, joint, seconds):
    robot, log = arm
    late = delay(log, seconds * (np.arange(6) == joint))
    found = look(robot, late)
    assert np.flatnonzero(found.delay).tolist() == [joint]
    assert found.delay[joint] == pytest.approx(seconds, abs=0.004)
    assert ("late" if seconds > 0 else "early") in found.description
    unmeasured = found.read(late, Structure.of(robot, MODEL)).unmeasured
    assert np.flatnonzero(unmeasured.any(0)).tolist() == [joint]
    assert unmeasured.sum() == pytest.approx(abs(seconds) / np.diff(log.t).mean(), abs=1)


def test_late_torque_chooses_no_band_in_which_it_is_read_or_fitted(arm, monkeypatch):
    robot, log = arm
    bands = []

    def choose(logs):
        bands.append(logs.samples[0].cutoff)
        return choose_reading(logs)

    monkeypatch.setattr(case, "choose_reading", choose)
    for by in (0.0, 0.204):
        found = analyze(robot, delay(log, np.full(6, by)), "none", replicates=0)
        bands.append(found.samples[0].cutoff)
    assert found.alternative.delay == pytest.approx(np.full(6, by), abs=0.004)
    assert len(set(bands)) == 1


@pytest.mark.parametrize("degrees, masses, offset", [(30.0, 2.0, 3.0), (180.0, 1.0, 0.0)])
def test_gravity_elsewhere_is_found_whatever_masses_and_offsets(degrees, masses, offset):
    robot, log = record("six-dof-arm", masses=masses)
    log = replace(log, tau=log.tau + offset)
    first, second = np.radians(degrees) * np.array(horizontal_axes(robot.gravity))
    stated = turn(robot.gravity, 0.6 * first + 0.8 * second)
    found = look(otherwise_stated(robot, stated), log)
    assert Tilt.of(robot.gravity, found.gravity).degrees < 2.0
    assert found.keeps_columns
    assert "gravity_tilt" in found.structure(Structure.of(robot, MODEL)).model.names


@pytest.mark.parametrize(
    "name, masses",
    [("two-link", 1.0), ("six-dof-arm", 1 / 3), ("3-rps", 10.0), ("3-rps", 1.0)],
)
def test_no_other_model_is_chosen_where_masses_alone_are_the_file_s_no_more(name, masses):
    for seed in range(6 if masses == 1.0 else 2):
        robot, log = record(name, seed=10 + seed, masses=masses, additive=0.05, correlation=0.95)
        assert look(robot, log) is None


@pytest.mark.parametrize(
    "effect, name",
    [
        ("stribeck_friction", "3-rps"),
        ("hysteresis", "six-dof-arm"),
        ("hysteresis=0.4", "five-bar"),  # alone it acts as late torque does
        ("position_friction", "3-rps"),
        ("position_friction=0.2", "two-link"),
    ],
)
def test_what_is_missing_anyway_votes_for_no_other_model(name, effect):
    robot, rng = Robot.load(name), default_rng(3)
    campaign = Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(2)])
    assert look(robot, *campaign.logs((effect,), Noise(additive=0.012), rng)) is None


@pytest.fixture(scope="module")
def turned():
    """The two-link arm, and two logs whose second torque has the wrong sign."""
    robot, log = record("two-link")
    logs = log, record("two-link", seed=2)[1]
    return robot, [replace(x, tau=x.tau * [1.0, -1.0]) for x in logs], logs


def test_every_verb_goes_on_under_the_other_model_and_says_so_first(turned):
    robot, logs, good = turned
    for verb in (analyze, prune):
        found, plain = (verb(robot, *x, replicates=20) for x in (logs, good))
        assert found.hints[0].startswith("The torque of elbow seems to have the wrong sign")
        assert found.hints[0].endswith("All results use this reading.")
        assert not found.nothing
        assert found.chosen.error_ra_validation == pytest.approx(
            plain.chosen.error_ra_validation, rel=1e-6
        )


def test_it_is_diagnosed_under_the_other_model_and_held_out_logs_do_not_choose(turned):
    robot, logs, good = turned
    found = diagnose(robot, *logs, quick=True)
    assert found.hints[0].startswith(found.alternative)
    assert "elbow seems to have the wrong sign" in found.alternative
    assert found.to_dict()["roles"]["alternative"] == found.alternative
    assert found.held_before < 0.2
    assert not diagnose(robot, good[0], logs[1], quick=True).alternative
    assert not diagnose(robot, *logs, quick=True, fixed=True).alternative


def test_columns_in_a_cycle_are_found_in_a_chain_and_on_legs(arm):
    for (robot, log), order in (
        (arm, [0, 2, 4, 3, 1, 5]),
        (record("3-rps", samples=1500), [1, 2, 0]),
    ):
        found = look(robot, replace(log, tau=log.tau[:, order]))
        assert found.order.tolist() == np.argsort(order).tolist()
        assert found.holds


def test_a_column_is_as_large_as_in_the_rows_of_the_joint_that_it_is_read_at():
    """Torque without a cause leaves all of it, also in rows in which another joint moves."""
    robot, log = record("two-link")
    first = (np.arange(len(log)) < len(log) // 2)[:, None]
    q = np.where(first == [1, 0], log.q, log.q[len(log) // 2])
    tau = default_rng(0).standard_normal(q.shape) * np.where(first, 10.0, 0.1)
    logs = known(robot, replace(log, q=q, tau=tau))
    rows = TorqueRows.of(logs.structure, logs.samples)
    assert rows.fit(replace(Reading.literal(robot), order=np.array([1, 0]))).min() > np.log(0.5)


def test_a_reading_that_other_rows_do_not_confirm_is_a_question_and_is_not_used(arm):
    robot, log = arm
    # The sign changes in every other block: one reading holds in half of the rows only.
    half = np.arange(len(log)) * 8 // len(log) % 2 == 0
    tau = log.tau.copy()
    tau[half, 2] *= -1.0
    wrong = replace(log, tau=tau)
    found = look(robot, wrong)
    assert found is None or not found.holds
    held = [Verification(8.0, 4.0, predicted=20.0, candidates=k).holds for k in (1, 1000)]
    assert held == [True, False]
    hints = analyze(robot, wrong, "none", replicates=20).hints
    assert not any("All that follows" in hint for hint in hints)


def test_on_clean_logs_at_most_eight_regressors_are_evaluated(arm, monkeypatch):
    robot, log = arm
    evaluated = []
    compute = LogPart._computed

    def computed(part, *windows):
        evaluated.append(part)
        return compute(part, *windows)

    monkeypatch.setattr(LogPart, "_computed", computed)
    assert look(robot, log, replace(record("six-dof-arm", seed=2)[1], name="second")) is None
    assert len(evaluated) <= 8


def test_a_zero_that_acts_as_a_turned_body_is_told_with_that_body(logs_of):
    logs = [replace(log, q=log.q + np.array([0, 0.07])) for log in logs_of("two-link")]
    (said,) = analyze("two-link", logs[:2], logs[2:3], replicates=0).warnings
    assert "positions of elbow are read 4.1° too large" in said


def test_a_file_with_coupled_motors_is_compared_with_its_logs(logs_of):
    robot = Robot.load("scara").with_body("flange", mass=3.0)
    found = analyze(robot, logs_of("scara")[:2], "none", replicates=0)
    assert any("contradict the robot file" in text for text in found.warnings)
