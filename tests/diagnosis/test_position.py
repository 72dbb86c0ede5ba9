"""Torque that depends on a position: learned where it is, named nowhere else; as one name."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Noise, Robot, diagnose
from identifiability.estimation.prediction import predict
from identifiability.simulation import Campaign, random_trajectory

from .conftest import campaign

NOISE = Noise(additive=0.012, correlation=0.9, encoder=2e-5)


def planted(what, joint):
    """Torque over the position of one joint with a tenth of its torque's size, (N, n)."""
    c = campaign("five-bar")
    q = c.move.q[:, joint]
    u = 2 * (q - q.min()) / np.ptp(q) - 1
    angle = 1.2 * u + 0.5
    force = {
        "nothing": 0 * u,
        "cable": 0.3 * u + np.exp(3 * (u - 1)) - 0.4 * np.tanh(3 * (u + 0.4)),
        # Free length 0.8, pivots at 1 and 0.5 from the joint: it passes its dead centre.
        "extension spring": (1 - 0.8 / np.sqrt(1.25 + np.cos(angle))) * np.sin(angle),
    }[what]
    size = 0.1 * np.sqrt(np.mean(c.torque[:, joint] ** 2)) / max(np.std(force), 1e-12)
    out = np.zeros_like(c.torque)
    out[:, joint] = force * size
    return out


def find(what, joint, effects):
    c = campaign("five-bar")
    logs = c.logs(planted(what, joint), NOISE, default_rng(5))
    return diagnose(c.robot, logs[:4], logs[4:], effects=effects, forward=False, quick=True)


CASES = [("cable", 0), ("extension spring", 1), ("cable", 1), ("extension spring", 0)]
#: What a curve over the position could be taken for.
LIKE = (
    "position_torque", "joint_stiffness", "torque_offset", "free_spring", "gravity_spring",
    "position_ripple", "position_friction",
)  # fmt: skip


@pytest.mark.parametrize(
    "what, joint, effects",
    [(*CASES[0], LIKE), *(pytest.param(*c, None, marks=pytest.mark.everything) for c in CASES)],
)
def test_a_curve_is_learned_and_named_with_its_joint(what, joint, effects, named):
    """Its error on unseen motion is within a tenth of that without anything planted."""
    d, bare = (find(w, joint, effects) for w in (what, "nothing"))
    assert bare.effects == ()
    assert named(d) == [("position_torque", (campaign("five-bar").robot.joints[joint],))]
    # Bodies have most of a spring: without a name the error is 1.3 times that of the noise alone.
    assert d.held_before > 1.25 * d.held_after
    assert d.held_after < 1.1 * bare.held_after
    (curve,) = d.curves
    truth = planted(what, joint)[:, joint]
    assert (curve.joint, curve.against) == (joint, "position")
    # What is drawn is the curve, but for what bodies say as well (a constant and their gravity).
    at = campaign("five-bar").move.q[:, joint]
    order = np.argsort(at)
    expected = np.interp(curve.x, at[order], truth[order])
    like = np.column_stack([np.ones_like(curve.x), np.sin(curve.x), np.cos(curve.x)])
    left = [y - like @ np.linalg.lstsq(like, y, rcond=None)[0] for y in (curve.learned, expected)]
    assert np.corrcoef(*left)[0, 1] > 0.6
    # The model that is given away has it.
    assert d.model.names[-1] == "position_torque"
    names = [p.name for p in d.model.parameters(d.robot)]
    assert set(d.effects[0].placements[0].parameters) <= set(names)


@pytest.mark.everything
def test_the_model_that_is_kept_predicts_farther_than_was_fitted_as_was_verified(named):
    """Splines that the fitted motion hardly reaches are anything unless they are smooth."""
    c = campaign("palletizer")
    hidden = c.hidden(["position_friction@turntable=0.05"])
    logs = c.logs(hidden, NOISE, default_rng(0))
    fitted = max(np.abs(log.q[:, 0]).max() for log in logs[:4])
    assert np.abs(logs[4].q[:, 0]).max() > 1.05 * fitted
    names = ("position_friction",)
    d = diagnose(c.robot, logs[:4], logs[4:], effects=names, forward=False, quick=True)
    assert named(d) == [("position_friction", ("turntable",))]
    unseen = replace(d.completed.regression(d.validation), instruments=None)
    kept = predict(unseen, d.fit.values[:, None]).joint_rms()[0, 0]
    before, verified = d.gap.joint_rms()[0, [0, -1]]
    assert verified < 0.5 * before
    assert kept < 1.1 * verified


def test_ripple_of_a_geared_motor_is_named_with_its_period_and_size(tmp_path):
    """Two waves a turn of a motor that turns twenty times for its joint."""
    plain = Robot.load("two-link").path
    (tmp_path / "arm.xml").write_bytes(plain.read_bytes())
    sidecar = plain.with_suffix(".toml").read_text() + "\n[torque]\nratio = { elbow = 20.0 }\n"
    (tmp_path / "arm.toml").write_text(sidecar)
    robot = Robot.load(tmp_path / "arm.xml")
    rng = default_rng(7)
    c = Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(5)])
    wave = {"cogging": lambda _speed, position, _load: np.sin(2 * 20 * position + 0.7)}
    logs = c.logs(c.hidden(["cogging@elbow=0.05"], wave), NOISE, default_rng(0))
    d = diagnose(robot, logs[:4], logs[4:], forward=False, quick=True)
    (e,) = d.effects
    (placed,) = e.placements
    assert (e.name, placed.place) == ("gear_ripple", "elbow")
    assert placed.shape == pytest.approx(2 * np.pi / 20 / 2)
    size = 0.05 * np.sqrt(2 * np.mean(c.torque[:, 1] ** 2))
    assert np.hypot(*placed.values) == pytest.approx(size, abs=4 * np.hypot(*placed.errors))
    assert np.arctan2(*placed.values[::-1]) == pytest.approx(0.7, abs=0.08)


def test_a_spring_far_from_its_rest_is_told_from_an_offset_by_its_slope():
    """Of what it adds 99 % is an offset, and the rest is surely there.

    A straight curve is that spring as well; noise that bends it once in a hundred names it first.
    """
    c = campaign("two-link")
    q = c.move.q[:, 1]
    hidden = np.zeros_like(c.torque)
    hidden[:, 1] = 0.3 * (8.0 - (q - q.mean()) / np.ptp(q))
    springs = 0
    for seed in (1, 2, 3):
        logs = c.logs(hidden, NOISE, default_rng(seed))
        d = diagnose(c.robot, logs, effects=LIKE, forward=False, quick=True)
        (e,) = d.effects
        (placed,) = e.placements
        assert e.joints == ("elbow",)
        assert "free_spring" in (e.name, *e.alternatives)
        if e.name == "free_spring":
            springs += 1
            slope = placed.values[0], -0.3 / np.ptp(q)
            assert slope[0] == pytest.approx(slope[1], abs=4 * placed.errors[0])
    assert springs >= 2


def test_motors_of_one_pitch_are_found_whatever_their_ranges(logs_of):
    logs = [replace(x, tau=x.tau + np.sin(5 * np.pi * x.q)) for x in logs_of("two-link")]
    d = diagnose("two-link", logs, effects=["position_ripple"], forward=False, quick=True)
    assert_allclose([p.shape for p in d.effects[0].placements], [0.4, 0.4], rtol=0.01)
