"""A load that is planted is found; what is not known of the robot is not known of the load."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import (
    IdentifiabilityError,
    Noise,
    Preparation,
    Robot,
    analyze,
    compare,
    payload,
    simulate,
)
from identifiability.foundation.findings import of_key
from identifiability.physical.pseudo_inertia import check_body
from identifiability.regression.reduction import DEFAULT_EFFECTS, LadderEntry, ModelEntry
from identifiability.report.pages import comparison_moving, payload_moving
from identifiability.simulation.motion import find_motion

from .planted_load import PlantedLoad, load_torque

ARM = "six-dof-arm"


@pytest.fixture
def of_arm(fit):
    return partial(payload, ARM, fit(ARM))


def test_a_load_without_noise_is_found_exactly(fit, make_logs, planted):
    kept = fit(ARM)
    nominal = kept.structure.nominal_base - kept.submodel.fixed
    exact = np.linalg.lstsq(kept.submodel.M, nominal, rcond=None)[0]
    sure = replace(kept.spread, covariance=0 * kept.covariance)
    known = replace(kept, values=exact, spread=sure)
    found = payload(ARM, known, make_logs(ARM, planted, size=0.0)[1])
    assert [q.value for q in found.quantities] == pytest.approx(
        planted.quantities, rel=1e-4, abs=1e-6
    )
    assert found.body == "link_6"
    assert max(found.estimate.torque.errors[1]) < 1e-4


@pytest.mark.parametrize(
    "name, effect", [(ARM, "torque_scale@joint_3"), ("two-link", "load_dependent_friction")]
)
def test_a_load_acts_on_scales_and_on_friction_by_load(make_logs, moves, planted, name, effect):
    own = moves(name)
    load = load_torque(own.robot, own.robot.bodies[-1], planted, own.move, own.rigid.tau)
    empty, loaded = (
        make_logs(
            name,
            hung,
            seed,
            extra=-0.2 * np.eye(6)[2] * (own.torque + more)
            if name == ARM
            else 0.2 * np.abs(own.rigid.tau + more) * np.sign(own.move.dq),
        )
        for seed, hung, more in ((1, None, 0.0), (2, planted, load))
    )
    assert not compare(name, *empty).changes
    ladder = LadderEntry(models=[ModelEntry(name="one", effects=[*DEFAULT_EFFECTS, effect])])
    (change,) = (found := compare(name, empty, loaded, ladder=ladder)).changes
    assert comparison_moving(found).torque.name == change.felt.joint
    result = analyze(name, empty[0], ladder=ladder, replicates=0)
    weighed = payload(name, result, loaded[0], empty[1])
    assert not weighed.estimate.changes
    for size, sd in ((change.sizes[0], change.sd[0]), (weighed.mass.value, weighed.mass.sigma)):
        assert abs(size - planted.mass) < 3 * sd < 0.3


def test_a_load_hangs_from_the_base_as_it_leans():
    robot = Robot.load(ARM)
    rng = default_rng(0)
    motion = find_motion(robot, "random", 800, rng)
    empty, loaded = (
        simulate(x.turned(np.array([0.5, -0.4, -9.8])), motion, noise=Noise(torque=0.01), rng=rng)
        for x in (robot, robot.with_payload(mass=3.0))
    )
    leans = LadderEntry(models=[ModelEntry(name="a", effects=[*DEFAULT_EFFECTS, "gravity_tilt"])])
    result = analyze(robot, empty, "none", ladder=leans, replicates=0)
    mass = payload(robot, result, loaded).as_measured[0]
    assert abs(mass.value - 3.0) < mass.half < 0.04


@pytest.mark.parametrize("mass, told", [(1.5, True), (0.02, False)])
def test_numbers_of_either_sign_may_be_zero_and_a_mass_may_not(of_arm, make_logs, mass, told):
    load = PlantedLoad(mass, np.array([0.0, -0.03, 0.1]), mass * np.diag([0.008, 0.009, 0.006]))
    found = of_arm(make_logs(ARM, load, seed=3)[1])
    zero = {q.name for q in found.quantities if q.low <= 0 <= q.high}
    assert {"centre x", "Ixy", "Ixz", "Iyz"} <= zero
    assert {q.told for q in found.quantities} == {told}
    assert ("mass" in zero) != told
    assert "excite" not in str(found.next())  # no motion tells more


@pytest.mark.parametrize("name", [pytest.param(ARM, marks=pytest.mark.everything), "two-link"])
def test_intervals_hold_planted_loads(name, fit, make_logs):
    inside = []
    off = []
    for seed in range(5):
        rng = default_rng(seed)
        load = PlantedLoad.draw(float(rng.uniform(0.5, 5.0)), rng)
        loaded = make_logs(name, load, seed=10 + seed)[1]
        for without in ([], [make_logs(name, seed=50 + seed)[1]]):
            found = payload(name, fit(name), loaded, without)
            assert not check_body(found.parameters, "load")
            true = load.quantities
            inside += [q.low <= t <= q.high for q, t in zip(found.quantities, true, strict=True)]
            assert all(q.low > 0 or q.high < 0 for q in found.quantities[4:7] if q.told)
            off.append(found.mass.value / load.mass - 1)
    assert np.mean(inside) >= 0.9
    assert abs(np.mean(off)) < 0.03


@pytest.mark.parametrize("entered", [False, True])
@pytest.mark.parametrize("compensated", [False, True])
def test_a_load_is_weighed_whether_or_not_its_weight_was_subtracted(
    fit, make_logs, planted, weigh, compensated, entered
):
    bare, weight = weigh(ARM)
    taken = -bare if compensated else 0 * bare
    kept = fit(ARM)
    if compensated:
        kept = analyze(ARM, make_logs(ARM, seed=1, extra=taken)[0], replicates=0)
    found = payload(ARM, kept, make_logs(ARM, planted, seed=5, extra=taken - entered * weight)[1])
    assert found.mass.low < planted.mass < found.mass.high
    assert abs(found.mass.value - planted.mass) < 0.1
    assert found.mass.half < (0.35 if compensated else 0.11)
    assert bool(of_key(found.hints, "load_weight")) == (compensated != entered)
    assert not found.caveats


def test_a_log_with_less_than_the_fitted_ones_has_no_load(of_arm, make_logs):
    less = PlantedLoad(-1.5, np.zeros(3), -0.01 * np.eye(3))
    found = of_arm(make_logs(ARM, less, seed=3)[1])
    assert "less than in" in found.answer
    assert "less on it" in str(found.next())
    assert payload_moving(found).mark != "blue"
    assert -1.6 < found.mass.low < found.to_frame().high["mass"] < -1.39
    assert not any(q.told for q in found.quantities)


def test_a_load_that_the_controller_subtracts_altogether_is_asked_for(fit, make_logs):
    found = payload("two-link", fit("two-link"), make_logs("two-link", seed=5)[1])
    assert "Nothing surely hangs" in found.answer
    assert "Enter a load of zero at the pendant" in found.details


def test_what_the_result_does_not_know_of_the_robot_is_not_known_of_the_load(
    fit, make_logs, planted
):
    log = make_logs(ARM, planted, seed=3)[1]
    kept = fit(ARM)
    sure, vague = (
        replace(kept, spread=replace(kept.spread, covariance=factor * kept.covariance))
        for factor in (1e-6, 100.0)
    )
    at = [payload(ARM, one, log).mass.half for one in (sure, kept, vague)]
    assert 1.2 * at[0] < at[1] < 0.7 * at[2]


def test_what_a_motion_does_not_tell_is_said(fit, make_logs, planted):
    found = payload("two-link", fit("two-link"), make_logs("two-link", planted, seed=3)[1])
    by = {q.name: q for q in found.quantities}
    assert by["mass"].told > by["Ixy"].told
    assert "Ixx" in found.details.partition("Not identifiable:")[2]
    assert by["Ixz"].why == "not identifiable from this motion"
    assert np.isfinite([q.value for q in by.values()]).all()


def test_an_effect_that_the_model_lacks_is_no_change_of_the_robot(
    of_arm, make_logs, planted, moves
):
    odd = 12.0 * np.sin(7.0 * moves(ARM).move.q) * np.eye(6)[2]
    log = make_logs(ARM, planted, seed=10, extra=odd)[1]
    for bare in ([], [make_logs(ARM, seed=50, extra=odd)[1]]):
        details = of_arm(log, bare).details
        assert "unction of position in joint_3 in addition to the load" in details
        assert ("without=" in details) != bool(bare)
    far = np.roll(odd, -1, 1) * moves(ARM).move.dq[:, :1]
    pair = [make_logs(ARM, x, extra=4 * far)[1] for x in (planted, None)]
    assert "the intervals may miss it" in of_arm(*pair).details
    assert not of_arm(make_logs(ARM, planted, seed=11)[1]).caveats


@pytest.mark.parametrize("paired", [False, True])
def test_friction_that_changed_is_estimated_beside_the_load_and_said(
    of_arm, make_logs, planted, moves, paired
):
    warm = 12.0 * np.sign(moves(ARM).move.dq) * np.eye(6)[2]
    bare = [make_logs(ARM, seed=21)[1]] if paired else []
    same, found = (
        of_arm(make_logs(ARM, planted, 20, extra=extra)[1], bare) for extra in (None, warm)
    )
    assert not same.estimate.changes
    assert [c.place for c in found.estimate.changes] == ["joint_3"]
    assert "riction of joint_3 rose by" in found.details
    assert not found.caveats
    assert found.mass.value == pytest.approx(same.mass.value, abs=0.4 * same.mass.half)
    assert found.mass.half == pytest.approx(same.mass.half, rel=0.1)


def test_noise_of_the_motion_is_said_where_it_is_large(make_logs, planted):
    empty, loaded = (log.without(["dq", "ddq"]) for log in make_logs(ARM, planted))
    noise = default_rng(0).normal(scale=1e-3, size=loaded.q.shape)
    result = analyze(ARM, empty, replicates=0, preparation=Preparation(cutoff=10.0))
    found = payload(ARM, result, replace(loaded, q=loaded.q + noise))
    assert "noise of the measured motion" in str(found.hints)


def test_of_logs_with_different_loads_it_is_said_which_has_more(of_arm, make_logs, planted):
    light = make_logs(ARM, planted, seed=12)
    heavy = make_logs(ARM, replace(planted, mass=2.5), seed=13)
    same = of_arm([light[0], light[1]])
    assert not same.estimate.changes
    assert "The logs agree." in same.details
    mixed = of_arm([light[0], heavy[1]])
    (change,) = mixed.estimate.changes
    assert (change.kind, change.place) == ("load", "link_6")
    masses = mixed.mass.value + change.sizes[0] * np.array([0, 1])
    assert sorted(masses) == pytest.approx([1.52, 2.5], abs=0.3)
    assert "the logs have different loads" in mixed.details


def test_the_command_answers_first_and_writes_what_was_asked(
    fit, make_logs, planted, succeeds, tmp_path
):
    result, loaded, bare = (tmp_path / f for f in ("result.json", "with.csv", "without.csv"))
    result.write_text(
        json.dumps({"robot": {"name": ARM}, "fit": {**fit(ARM).to_dict(), "preparation": {}}})
    )
    for path, log in ((loaded, make_logs(ARM, planted, seed=2)[1]), (bare, make_logs(ARM)[1])):
        log.to_frame().to_csv(path, index=False)
    page, data = tmp_path / "load.html", tmp_path / "load.json"
    words = [ARM, result, loaded, "--without", bare, "--report", page, "--json", data]
    out = succeeds("payload", *words)
    assert "hangs on link_6" in out.stdout.splitlines()[0]
    content = json.loads(data.read_text())
    by = {q["name"]: q for q in content["quantities"]}
    assert by["mass"]["low"] < 1.52 < by["mass"]["high"]
    assert "hangs on link_6" in page.read_text()


def test_bodies_and_results_that_do_not_fit_are_refused(fit, make_logs):
    kept, log = fit(ARM), make_logs(ARM)[1]
    for says, *given, body in (
        ("has no moving body 'link_7'", ARM, kept, log, "link_7"),
        ("stands on both sides", ARM, kept, log, log, None),
        ("only if the mass of the load is known", ARM, log, log, None),
        (r"not belong to robot.xml.*six-dof-arm", "two-link", kept, make_logs("two-link")[1], None),
    ):
        with pytest.raises(IdentifiabilityError, match=says):
            payload(*given, body=body)
