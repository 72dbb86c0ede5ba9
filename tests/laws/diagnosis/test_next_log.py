"""How long the next log is: what it says, how much of it is looked at, which one is asked for."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability import Robot
from identifiability.estimation.noise import ARNoise, JointNoise, JointRuns, find_runs
from identifiability.foundation.errors import ClosureError
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.regression.regression import Regression
from identifiability.simulation import random_trajectory
from identifiability.workflows.diagnose import find_next, next_experiment
from identifiability.workflows.diagnose.motion import MOST_IN_ALL, prepare_rows
from identifiability.workflows.diagnose.next_experiment import Told
from identifiability.workflows.diagnose.rules import Rules
from identifiability.workflows.excite.criteria import pose_question


@pytest.fixture
def ask(monkeypatch):
    """Ask for a motion of which a period of so many seconds adds so much to the chance."""

    def run(says, seen=np.inf, closes=True, same=False):
        tried = []

        def find_motion(_question, known, series, *, samples, **_):
            tried.append((series.period, known.samples, samples))
            if len(tried) > 1 and not closes:
                raise ClosureError("elsewhere")
            return SimpleNamespace(trajectory=series)

        def along(_d, series):
            return says[series.period] * np.eye(1), seen

        asked = SimpleNamespace(
            question=None, known=None, weights=None, chance=lambda G: min(float(G[0, 0]), 1.0),
            names=("a", "b"), hidden=False, same=same,
        )  # fmt: skip
        told = SimpleNamespace(known=np.zeros((1, 1)), along=along)
        stubs = {"find_motion": find_motion, "ask_open": lambda *_: asked,
                 "Told": SimpleNamespace(of=lambda *_: told)}  # fmt: skip
        for name, stub in stubs.items():
            monkeypatch.setattr(next_experiment, name, stub)
        sample = SimpleNamespace(name="first", output_times=lambda: np.arange(4) * 0.1)
        d = SimpleNamespace(robot=Robot.load("two-link"), samples=[sample], rules=Rules())
        found = find_next.__wrapped__(d, duration=10.0)  # no diagnosis is made
        return found.excitation.trajectory.period, found.periods, found.chance, tried

    return run


def test_the_fewest_periods_that_are_likely_to_decide_are_asked_for_and_nothing_slower_is_tried(
    ask,
):
    assert ask({10.0: 0.12}) == (10.0, 8, pytest.approx(0.96), [(10.0, 100.0, 1000)])
    assert ask({10.0: 0.03})[1] == 32


def test_where_these_are_not_likely_to_decide_a_longer_log_and_a_slower_motion_are_asked_for(ask):
    period, periods, chance, tried = ask({10.0: 0.01, 20.0: 0.005})
    assert (period, periods, chance) == (10.0, 128, 1.0)
    # The slower one is made for the whole log, of which the old ones are but a small part.
    assert tried == [(10.0, 100.0, 1000), (20.0, 3200.0, 2000)]
    assert ask({10.0: 0.01, 20.0: 0.03})[:2] == (20.0, 32)  # 640 s, not 1280
    assert ask({10.0: 0.001, 20.0: 0.0})[:3] == (10.0, 128, pytest.approx(0.128))
    assert ask({10.0: 0.01}, closes=False)[:2] == (10.0, 128)
    assert len(ask({10.0: 0.001}, same=True)[3]) == 1


def test_no_longer_log_is_asked_for_than_a_diagnosis_looks_at(ask):
    assert ask({10.0: 0.01, 20.0: 0.0}, seen=20.0)[:3] == (10.0, 32, pytest.approx(0.2))


def test_what_a_motion_would_say_is_what_its_log_says():
    """Sign and torque are low-passed alike, which takes most of what is fast from friction."""
    robot, n, periods = Robot.load("two-link"), 2, 15
    path = random_trajectory(robot, np.random.default_rng(0))
    pair = ("coulomb_friction@shoulder", "stribeck_friction@shoulder")
    question = pose_question(robot, "separate", ["rigid_body", "viscous_friction"], None, pair)
    one = JointNoise(np.arctanh([0.6]), np.eye(1), 0.1, 100.0, 1.0)
    t = np.arange(periods * path.samples) * path.period / path.samples
    q = path.motion(t)[0]
    log = Log("long", robot.joints, t, q, np.ones((len(t), n)), None, None, "")
    samples = prepare_rows(robot, log, None)
    d = SimpleNamespace(robot=robot, preparation=Preparation(), samples=[samples])
    noise = ARNoise((one, one))
    gram, seen = Told(question, noise, np.eye(1)).along(d, path)
    regression = Regression(robot, question.model, (samples,), question.columns)
    chunks = [(c.W.copy(), c.data) for part in regression.parts() for c in part.chunks()]
    W, data = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    white = noise.whiten(W, JointRuns.of(find_runs([samples]), data)).reshape(-1, W.shape[2])
    share = np.diag(gram) / ((white**2).sum(0) / periods)
    assert np.all(share > 0.85)  # the low-pass takes the ends, of few periods more than of many
    assert np.all(share < 1.05)
    # Both halves of the new log and the old one are looked at alike: each is long enough.
    step = float(np.median(np.diff(samples.output_times())))
    assert seen == pytest.approx(2 / 3 * MOST_IN_ALL * step / path.period, rel=0.01)
