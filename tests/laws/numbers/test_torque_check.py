"""Torque columns that are exchanged or turned, told from numbers alone."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.foundation.names import Parameter
from identifiability.regression.mix_up import find_mix_up
from identifiability.regression.regression import Regression

JOINTS = ("hip", "knee", "toe")


@dataclass
class Piece:
    """Prepared samples whose motion is the regressor itself."""

    W: np.ndarray
    tau: np.ndarray
    again: int = 0

    @property
    def at(self):
        return slice(None)

    @property
    def motion(self):
        return self

    def silenced(self, x):
        return x

    def __len__(self):
        return len(self.tau)

    @property
    def t(self):
        return np.arange(len(self), dtype=float)

    @property
    def actuated_v(self):
        return np.zeros(self.tau.shape)

    moves = dwells = None

    def down(self, values):
        return values

    @property
    def torque(self):
        return self.tau

    raw = torque

    def masked(self, values):
        return values


class Made:
    """A log of numbers."""

    def __init__(self, W, tau):
        self.W, self.tau = W, tau
        self.outputs = len(tau)
        self.survey = SimpleNamespace(kept=len(tau), outputs=len(tau))

    def thin(self, step):
        return Made(self.W[::step], self.tau[::step])

    def pieces(self, size):
        for a in range(0, len(self.tau), size):
            yield Piece(self.W[a : a + size], self.tau[a : a + size])


class Columns:
    """A model that returns the regressor it is given."""

    def __init__(self, parameters):
        self.made = parameters

    def parameters(self, _robot):
        return self.made

    def widths(self, _robot):
        return [len(self.made)]

    def regressor(self, _robot, motion, out, widths=None, again=0):
        assert widths in (None, [len(self.made)])
        assert not again
        out = out[: len(motion.W)]
        out[:] = motion.W
        return out


def problem(friction, noise=1.0, samples=1000, mix=1.0):
    """Return W, tau and parameters: viscous and Coulomb friction a joint, and two masses."""
    n = len(JOINTS)
    rng = np.random.default_rng(0)
    W = np.zeros((samples, n, 2 * n + 2))
    for joint in range(n):
        W[:, joint, 2 * joint : 2 * joint + 2] = rng.normal(size=(samples, 2))
    W[:, :, 2 * n :] = mix * rng.normal(size=(samples, n, 2))
    phi = np.concatenate([np.ravel(friction), [3.0, -2.0]])
    tau = W @ phi + noise * rng.normal(size=(samples, n))
    kinds = [(j, k) for j in JOINTS for k in ("Fv", "Fc")]
    parameters = tuple(Parameter(j, k, "N·m", "friction", nonnegative=True) for j, k in kinds)
    parameters += (Parameter("arm", "mx", "kg·m", "body"), Parameter("arm", "my", "kg·m", "body"))
    return W, tau, parameters


def said(W, tau, parameters):
    robot = SimpleNamespace(joints=JOINTS, actuated=np.arange(len(JOINTS)))
    regression = Regression(robot, Columns(parameters), (Made(W, tau),))
    return find_mix_up(regression, np.array([p.nonnegative for p in parameters]))


def size_of(z, samples=1000, noise=1.0):
    """Return the value that is known to z white-noise deviations, of a column of unit rms."""
    return z * noise / np.sqrt(samples)


def test_torque_as_it_should_be_says_nothing():
    assert said(*problem(np.full((3, 2), 1.0))) == ""


@pytest.mark.parametrize(("z", "told"), [(5.0, False), (15.0, True)])
def test_a_sign_is_wrong_where_friction_is_surely_negative(z, told):
    """Surely: ten white-noise deviations, since the residual remembers."""
    friction = np.ones((3, 2))
    friction[1] = -size_of(z)
    text = said(*problem(friction))
    assert ("The torque of knee seems to have the wrong sign" in text) == told
    assert not told or "friction and rotor inertia come out negative" in text


def test_one_negative_number_of_a_joint_is_not_enough_and_two_of_which_one_is_positive_neither():
    for second in (0.0, 1.0):
        friction = np.ones((3, 2))
        friction[1] = [-1.0, second]
        assert said(*problem(friction)) == ""


def test_every_joints_sign_is_wrong_where_each_shows_it_by_a_number_and_none_denies_it():
    friction = np.zeros((3, 2))
    friction[:, 0] = -1.0
    assert "The torque of all joints seems to have the wrong sign" in said(*problem(friction))
    friction[2, 0] = 1.0
    assert said(*problem(friction)) == ""


def test_exchanged_columns_are_named():
    W, tau, parameters = problem(np.full((3, 2), 1.0))
    text = said(W, tau[:, [1, 0, 2]], parameters)
    assert "'hip.tau' from 'knee.tau', 'knee.tau' from 'hip.tau' the" in text
    text = said(W, tau[:, [1, 2, 0]], parameters)
    assert "The torque columns seem to be exchanged" in text
    for pair in ("'hip.tau' from 'toe.tau'", "'knee.tau' from 'hip.tau'",
                 "'toe.tau' from 'knee.tau'"):  # fmt: skip
        assert pair in text


def test_a_turned_column_is_named_where_the_others_know_its_sign():
    W, tau, parameters = problem(np.zeros((3, 2)), noise=0.1)
    text = said(W, tau * [1, -1, 1], parameters)
    assert "The torque of knee seems to have the wrong sign: with the other one" in text


@pytest.mark.parametrize(("share", "told"), [(0.35, True), (0.45, False)])
def test_another_order_must_leave_less_than_four_tenths_of_the_squares(share, told):
    """Noise of such a size that the right order leaves that share of what the wrong one does."""
    W, tau, parameters = problem(np.zeros((3, 2)), noise=0.0, samples=2000)
    wrong = tau[:, [1, 0, 2]]

    def left(torque):
        flat = (W / torque.std(0)[:, None]).reshape(-1, W.shape[2])
        right = (torque / torque.std(0)).ravel()
        flat = flat[:, np.abs(flat).max(0) > 0]
        return np.linalg.lstsq(flat, right, rcond=None)[1][0]

    noise = np.random.default_rng(1).normal(size=tau.shape)
    low, high = 0.0, 20.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        made = left(tau + middle * noise) / left(wrong + middle * noise[:, [1, 0, 2]])
        low, high = (middle, high) if made < share else (low, middle)
    text = said(W, wrong + low * noise[:, [1, 0, 2]], parameters)
    assert ("seem to be exchanged" in text) == told


def test_too_few_samples_and_torque_that_stands_still_say_nothing():
    W, tau, parameters = problem(-np.ones((3, 2)))
    assert said(W[:5], tau[:5], parameters) == ""
    tau[:, 0] = 1.0
    assert said(W, tau, parameters) == ""
