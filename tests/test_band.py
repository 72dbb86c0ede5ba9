"""Every verb low-passes a log alike."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import (
    Case,
    Model,
    Noise,
    Preparation,
    Robot,
    analyze,
    compare,
    inspect,
    payload,
    prepare_log,
    simulate,
)
from identifiability.regression.structure import Structure
from identifiability.simulation import PrescribedMotion, random_trajectory

RATE, SPEED, STEP = 200, 0.1, 0.003


@pytest.fixture(scope="module")
def two_link():
    robot = Robot.load("two-link")
    effects = ("rigid_body", "viscous_friction", "coulomb_friction")
    return robot, Structure.of(robot, Model.of(*effects))


@pytest.fixture(scope="module")
def coarse(two_link):
    """The elbow goes to and fro slowly on a coarse encoder; its even steps look like 17 Hz."""
    robot = two_link[0]
    rng = np.random.default_rng(1)
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


@pytest.mark.parametrize("verb", ["compare", "inspect", "payload", "predict"])
def test_every_verb_takes_the_same_band(two_link, coarse, verb, monkeypatch):
    robot, _ = two_link
    taken = []

    def prepare(robot, log, how, **options):
        taken.append(how)
        return prepare_log(robot, log, how, **options)

    monkeypatch.setattr("identifiability.workflows.case.prepare_log", prepare)
    # Readings are sought in another band.
    monkeypatch.setattr(Case, "widest_band", lambda _, motion: motion.how)
    other = replace(coarse.rows(0, 3500, "other"), sha256="other")
    asked = [coarse]
    if verb == "compare":
        asked = [coarse.rows(0, 1750, "one"), coarse.rows(1750, 3500, "two")]
        compare(robot, *(replace(x, sha256=x.name) for x in asked))
    elif verb == "inspect":
        inspect(robot, coarse)
    else:
        result = analyze(robot, coarse, preparation=Preparation(cutoff=5.65), replicates=10)
        result.predict(other) if verb == "predict" else payload(robot, result, other)
    cutoff = 5.65
    if verb in ("compare", "inspect"):
        # Logs after are compared in the band of the logs before.
        cutoff = analyze(robot, asked[:1], "none", replicates=0).samples[0].cutoff
    assert {how.cutoff for how in taken} == {cutoff}


def test_noise_of_the_motion_imitates_no_reading(two_link, coarse):
    # In the widest band, the torque of the shoulder seems to have another unit.
    result = analyze(two_link[0], coarse.rows(0, 1750, "one"), "none", replicates=0)
    assert "alternative" not in {hint.key for hint in result.hints}
