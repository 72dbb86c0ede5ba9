"""The null side of hints: sound data just inside a limit say nothing, data just outside do.

One row a limit. A limit that is loosened by a factor, or tightened, is noticed by its row.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability.logs.contradictions import contradictions, looks_like_degrees
from identifiability.logs.spectrum import Band, BandAdvice
from identifiability.logs.table_reader import unify_rates
from identifiability.quality import hints as torque_scale
from identifiability.report.answers.common import grade_of
from identifiability.workflows.analyze import workflow

N = 4000
RNG = default_rng(0)
#: At right angles to one another and to a constant, of unit rms.
WAVES = np.sqrt(N) * np.linalg.qr(np.column_stack([np.ones(N), RNG.normal(size=(N, 6))]))[0][:, 1:]


def logs(**given):
    """What is odd about two joints that turn, of which only this is looked at."""
    robot = SimpleNamespace(
        limits=np.array([[-1.0, 1.0]] * 2), actuated=np.array([0, 1]), angles="rad", closed=False,
        base=None, is_prismatic=lambda _: False, torque_units=("N·m",) * 2, speed_limits=[1.0, 2.0],
    )  # fmt: skip
    usual = {"robot": robot, "joints": ("a", "b"), "weighs": False, "recordings": ()}
    usual |= {"measured": np.ones(2, bool)}
    return SimpleNamespace(**usual | given)


# Torque in another unit.


def scaled(*factors, follows=1.0, felt=1.0):
    predicted = WAVES[:, :2] * [felt, 1.0]
    noise = np.sqrt(1 / follows**2 - 1) * WAVES[:, 4:] * [felt, 1.0]
    given = {"predicted": predicted, "torque": (predicted + noise) * factors,
             "stated": np.full((N, 2), np.nan), "ordinary": lambda _: np.ones((N, 1))}  # fmt: skip
    return [*torque_scale.find_torque_scale(logs(weighs=True, **given))]


# Columns at rates of their own.


def lacking(share):
    tau = np.sin(np.arange(N))
    tau[RNG.permutation(N)[: round(share * N)]] = np.nan
    return unify_rates({"t": np.arange(N) * 0.01, "a.q": np.sin(np.arange(N)), "a.tau": tau})[1]


def written_again(length, alike=1.0):
    """Runs of some length, a share of them, and of seven times that."""
    runs = np.where(np.arange(200) < 200 * alike, length, 7 * length)
    q = np.repeat(np.sin(np.arange(200.0)), RNG.permutation(runs))
    t = np.arange(len(q)) * 0.01
    return unify_rates({"t": t, "a.q": q, "a.tau": np.sin(np.arange(len(q)))})[1]


# Derivatives that contradict what they are derived from.


def derived(scale=1.0, unexplained=0.0, stands_out=1e9):
    """A velocity so many times too small, with as much of another motion, of a noisy position."""
    t = 0.01 * np.arange(N)
    noise = default_rng(1).normal(size=N) / np.sqrt(max(stands_out**2 - 1, 1e-300))
    q = np.sqrt(2) * np.sin(2 * np.pi * t) + noise
    other = np.sqrt(unexplained / (1 - unexplained))
    v = np.cos(2 * np.pi * t) - 2 * other * np.sin(4 * np.pi * t)
    v *= 2 * np.pi * np.sqrt(2) * (1 - unexplained) / scale
    names = SimpleNamespace(joints=("a",), t=t, q=q[:, None], dq=v[:, None], ddq=None)
    return contradictions(names)


# What is said of a cut-off, of logs beside each other, and of errors.


def band(cutoff=5.0, noise=0.0, advice=None):
    """A motion of one hertz, sampled five times as fast as the cut-off."""
    found = Band(cutoff, cutoff, 1.0, 9.0, noise, "", 5.0 * cutoff, advice)
    return " ".join(workflow.say_band(found, names=True))


def set_band(error=1.0, outputs=5.0):
    """A cut-off of 5 Hz that was set, with an error over that of a better one."""
    return band(advice=BandAdvice(4.0, outputs, 0.1, 0.1 * error))


def moved(most, end=1.0):
    """A joint with limits of ± 1, or others."""
    robot = SimpleNamespace(joints=("a",), limits=np.array([[-end, end]]), actuated=[0])
    robot.slides = np.array([False])
    return SimpleNamespace(
        robot=robot, motion=SimpleNamespace(actuated_q=np.array([[most], [most]]))
    )


#: What is asked, its limit in words, data just inside and data just outside.
ROWS = {
    "torque that is too large": (lambda x: scaled(x, x), 4.8, 5.2),
    "torque that is too small": (lambda x: scaled(1 / x, 1 / x), 4.8, 5.2),
    "torque that follows": (lambda x: scaled(9.0, 9.0, follows=x), 0.67, 0.73),
    "torque that is felt": (lambda x: not scaled(1.0, 9.0, felt=x), 0.019, 0.021),
    "cells that are empty": (lacking, 0.19, 0.21),
    "values written again": (written_again, 2, 3),
    "runs that are alike": (lambda x: written_again(4, x), 0.88, 0.92),
    "velocity too small": (lambda x: derived(scale=x), 1.22, 1.28),
    "velocity too large": (lambda x: derived(scale=1 / x), 1.22, 1.28),
    "velocity of another motion": (lambda x: derived(unexplained=x), 0.19, 0.21),
    "motion that stands out": (lambda x: derived(2.0, stands_out=x), 3.7, 4.3),
    "cut-off in the motion": (lambda x: band(cutoff=1 / x), 1 / 2.05, 1 / 1.95),
    "cut-off that was set": (lambda x: set_band(error=x), 1.019, 1.021),
    "band that was set": (lambda x: set_band(outputs=5.0 / x), 1.49, 1.51),
    "noise below the cut-off": (lambda x: band(noise=x), 0.195, 0.205),
    "very good no more": (lambda x: grade_of(x) != "very-good", 0.0299, 0.0301),
    "fair": (lambda x: grade_of(x) == "fair", 0.0799, 0.0801),
    "useless": (lambda x: grade_of(x) == "useless", 0.499, 0.501),
    "motion a turn off": (lambda x: [*torque_scale.find_beyond(moved(x))], -2 * np.pi, -1.5),
    "motion beside no limits": (
        lambda x: [*torque_scale.find_beyond(moved(1.5, np.inf if x else 1.0))], 1, 0
    ),
    "motion beyond limits": (lambda x: [*torque_scale.find_beyond(moved(x))], 1.005, 1.03),
    "positions that fit in degrees": (
        lambda x: looks_like_degrees(np.linspace(-x, x, N), -1.0, 1.0) or None, 1.005, 50.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", ROWS)
def test_sound_data_near_a_limit_say_nothing_and_data_beyond_it_do(what):
    ask, inside, outside = ROWS[what]
    assert not ask(inside)
    assert ask(outside)
