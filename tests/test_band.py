"""One coarse joint does not decide the band of all: predictions do, where joints disagree."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log, Robot, analyze, compare, inspect, payload
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.simulation import Noise, PrescribedMotion, random_trajectory, simulate
from identifiability.workflows import session
from identifiability.workflows.session import settle_band

RATE, SPEED, STEP = 200, 0.1, 0.003


@pytest.fixture(scope="module")
def two_link():
    robot = Robot.load("two-link")
    effects = ("rigid_body", "viscous_friction", "coulomb_friction")
    return robot, Structure.of(robot, Model.of(*effects))


@pytest.fixture(scope="module")
def coarse(two_link) -> Log:
    """The elbow goes to and fro slowly on a coarse encoder; its even steps look like 17 Hz."""
    robot, rng = two_link[0], np.random.default_rng(1)
    motion = PrescribedMotion.of(random_trajectory(robot, rng, samples=4000, period=20.0))
    q, dq, ddq = (np.array(x) for x in (motion.q, motion.dq, motion.ddq))
    dq[:, 1] = SPEED * np.tanh(60 * np.sin(2 * np.pi * 0.2 * motion.t))
    q[:, 1] = np.cumsum(dq[:, 1]) / RATE
    ddq[:, 1] = np.gradient(dq[:, 1], 1 / RATE)
    log = simulate(robot, PrescribedMotion(motion.t, q, dq, ddq))
    q = np.array(log.q)
    q[:, 1] = np.round(q[:, 1] / STEP) * STEP
    tau = Noise(additive=0.03, correlation=0.8).on_torque(log.tau, rng)
    return replace(log, q=q, tau=tau, dq=None, ddq=None)


def test_a_coarse_joint_that_seems_fast_has_no_say_where_predictions_are_worse(two_link, coarse):
    robot, structure = two_link
    assert (np.diff(coarse.q[:, 1]) == 0).mean() > 0.6
    assert settle_cutoff(robot, [coarse], None).cutoff > 20
    found = settle_band(structure, [coarse], None)
    assert found.cutoff < 10
    assert found.band.bandwidth < 1


def test_a_given_cutoff_stays_and_is_not_said_to_cut_steps(two_link, coarse):
    robot, structure = two_link
    given = Preparation(cutoff=5.65)
    assert settle_cutoff(robot, [coarse], given).band.bandwidth > 5.65
    found = settle_band(structure, [coarse], given)
    assert (found.cutoff, found.band.bandwidth < 1) == (5.65, True)
    hints = analyze(robot, coarse, preparation=given, replicates=0).hints
    assert not any("cuts into the motion" in h for h in hints)


def test_motion_that_is_fast_in_one_joint_keeps_its_band(two_link):
    robot, structure = two_link
    t = np.arange(3000) / RATE
    q = np.column_stack([0.8 * np.sin(2 * np.pi * 0.4 * t), 0.1 * np.sin(2 * np.pi * 3.0 * t)])
    dq = np.gradient(q, 1 / RATE, axis=0)
    log = simulate(robot, PrescribedMotion(t, q, dq, np.gradient(dq, 1 / RATE, axis=0)))
    log = replace(log, dq=None, ddq=None)
    assert settle_band(structure, [log], None).cutoff == settle_cutoff(robot, [log], None).cutoff


def test_where_joints_agree_nothing_is_fitted(two_link, monkeypatch, simulated_session):
    robot, structure = two_link
    log = replace(simulated_session("two-link", "a", 0, Noise(torque=0.02)), dq=None, ddq=None)
    monkeypatch.setattr(session, "_score", None)
    found = settle_band(structure, [log], None)
    assert found.cutoff == settle_cutoff(robot, [log], None).cutoff


@pytest.mark.parametrize("verb", ["compare", "inspect", "payload", "predict"])
def test_every_verb_takes_the_same_band(two_link, coarse, verb, monkeypatch):
    robot, _ = two_link
    taken = []

    def prepare(robot, log, how, **options):
        taken.append(how)
        return prepare_log(robot, log, how, **options)

    where = "inspect" if verb == "inspect" else "session"
    monkeypatch.setattr(f"identifiability.workflows.{where}.prepare_log", prepare)
    other = replace(coarse.cut(0, 3500, "other"), sha256="other")
    if verb == "compare":
        compare(robot, coarse, other)
    elif verb == "inspect":
        inspect(robot, coarse)
    else:
        result = analyze(robot, coarse, preparation=Preparation(cutoff=5.65), replicates=10)
        result.predict(other) if verb == "predict" else payload(robot, result, other)
    assert {(how.cutoff < 10, how.band.bandwidth < 1) for how in taken} == {(True, True)}
