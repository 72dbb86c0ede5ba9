"""What differs between logs: who has it, of which sign and size, and how sure that is."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot
from identifiability.estimation.differences import Compared, Differences, Known, pooled_values
from identifiability.estimation.mixed_model import EVERYWHERE
from identifiability.estimation.noise import split_runs
from identifiability.foundation.values import frozen
from identifiability.regression.columns import number
from identifiability.workflows.diagnose.changes import list_changes

N, LOGS, NOISE = 300, 3, 0.05
ASKED = np.array([0.0, 0.0, 1.0])
ROBOT = Robot.load("two-link")
ASKED_OF = ("payload", "coulomb_friction", "torque_offset")
CHANGES = number([c for c in list_changes(ROBOT, ["link2"]) if c.family.name in ASKED_OF])
NAMES = ("a", "b", "shoulder.Fc", "elbow.Fc")
FREE = Known.nothing(np.eye(4), np.array([0.0, 0.0, 2.0, 2.0]))
FRICTION, OFFSET = "coulomb_friction, 0", "torque_offset, 0"


@frozen
class Planted(Compared):
    """Rows of which it is known what a unit of each change does."""

    acts: dict

    def entries(self, candidates):
        found = {}
        for c in candidates:
            j = ROBOT.joints.index(c.place) if c.place in ROBOT.joints else None
            for kind, k in zip(c.kinds, c.columns, strict=True):
                for joint in (0, 1) if j is None else (j,):
                    found[joint, k] = self.acts[kind][:, joint] * np.array(c.logs)[self.log]
        return found


def rows(seed, levels=(2.0, 2.0, 2.0), offset=0.0, noise=NOISE):
    """Three logs of two joints: one column and friction of a level in each log, white noise."""
    rng = np.random.default_rng(seed)
    t, log = np.tile(np.arange(N) / 20.0, LOGS), np.repeat(np.arange(LOGS), N)
    smooth = np.stack([np.sin((1 + 0.3 * j) * t + log) + np.cos(2 * t + j) for j in range(2)], 1)
    sign = np.sign(np.cos(1.7 * t[:, None] + log[:, None] + [0.0, 1.0]))
    shapes = [smooth, smooth**2, sign * smooth, t[:, None] * smooth]
    shapes += list(0.1 * rng.standard_normal((6, *sign.shape)))
    y = 3.0 * smooth + 2.0 * sign
    y[:, 0] += (np.array(levels)[log] - 2.0) * sign[:, 0]
    y[:, 1] += offset * ASKED[log]
    y = y + noise * rng.standard_normal(y.shape)
    X, data = np.zeros((len(t), 2, 4)), np.ones(y.shape, bool)
    for j in range(2):
        X[:, j, j], X[:, j, 2 + j] = smooth[:, j], sign[:, j]
    return Planted(
        ROBOT,
        X=X,
        y=y - X @ FREE.base,
        raw=y,
        data=data,
        t=t,
        log=log,
        runs=split_runs([(k * N, (k + 1) * N) for k in range(LOGS)], data),
        pieces=(),
        seen=np.arange(len(t)),
        torque=X @ FREE.base,
        acts=dict(zip(CHANGES[1].kinds, shapes, strict=True))
        | {"Fc": sign, "off": np.ones(y.shape)},
    )


def differences(own, patterns=(ASKED,), known=FREE, **more):
    return Differences.of(own, CHANGES, (), known, patterns, names=NAMES, **more)


def named(found):
    return {term.key for term in found.model.search()}


def test_logs_that_drift_by_three_percent_are_unchanged():
    assert named(differences(rows(0))) == set()
    assert named(differences(rows(1, levels=(2.04, 1.97, 2.0)))) == set()


def test_what_is_in_the_logs_asked_about_is_named_with_sign_and_size():
    found = differences(rows(2, levels=(2.0, 2.0, 1.2), offset=0.3))
    assert named(found) == {(FRICTION, "shoulder"), (OFFSET, "elbow")}
    terms = found.model.search()
    value, covariance = (x[found.model.fixed :] for x in found.solve(terms))
    for k, term in enumerate(terms):
        true = 0.3 if term.key[0] == OFFSET else -0.8
        assert value[k] == pytest.approx(
            true, abs=4 * np.sqrt(covariance[k, found.model.fixed + k])
        )


def test_of_three_logs_the_odd_one_is_found():
    single = tuple(np.eye(LOGS)[:2])
    found = differences(rows(3, levels=(2.0, 2.6, 2.0)), (ASKED, *single))
    (term,) = found.model.search()
    assert found.whose(term).odd("abc") == "b"


def test_families_and_places_share_the_prior_odds():
    found = differences(rows(4))
    total = sum(np.exp(-group.price) for group in found.model.groups)
    assert total == pytest.approx(1.0)
    assert (FRICTION, EVERYWHERE) in {group.key for group in found.groups}


def test_values_that_are_known_count_as_observations():
    own, M = rows(5), np.eye(4)
    truth = np.array([3.0, 3.0, 2.0, 2.0])
    plain = differences(own)
    value, covariance = plain.solve()
    sure = Known.of(truth, M, 1e-12 * np.eye(4), np.zeros((4, 0)))
    vague = Known.of(truth + 0.1, M, 1e6 * np.eye(4), np.zeros((4, 0)))

    def solved(known):
        about = replace(own, X=own.X @ known.directions, y=own.raw - own.X @ known.base)
        return known.directions @ differences(about, known=known).solve()[0][:4]

    assert np.abs(solved(sure)).max() < 1e-5
    found = vague.base + solved(vague)
    assert found == pytest.approx(
        FREE.base + value[:4], abs=0.02 * np.sqrt(covariance[0, 0]) + 1e-6
    )


def test_each_log_counts_by_its_own_noise():
    own, rng = rows(6), np.random.default_rng(66)
    more = 12 * NOISE * rng.standard_normal(own.y.shape) * (own.log == 1)[:, None]
    before, after = (
        np.sqrt(np.diag(differences(logs).solve()[1])[:4])
        for logs in (own, replace(own, y=own.y + more))
    )
    assert (after < 1.5 * before).all()  # of two logs of three


def test_what_logs_of_one_motion_differ_by_has_nothing_of_the_rest():
    """A function of the motion cancels, the sign is that of later less earlier."""
    pair, rng = rows(7), np.random.default_rng(8)
    y = 0.5 * pair.acts["Fc"] * [1.0, 0.0] + NOISE * rng.standard_normal(pair.y.shape)
    known = Known.nothing(FREE.directions[:, :0], FREE.base)
    pair = replace(pair, X=pair.X @ known.directions, y=y, log=0 * pair.log)
    found = differences(pair, (np.ones(1),), known)
    (term,) = found.model.search()
    assert term.group.place == "shoulder"
    assert found.solve((term,))[0][-1] == pytest.approx(0.5, abs=0.05)


def test_pooled_values_are_those_of_all_rows():
    own = rows(10, noise=0.0)
    base = pooled_values(own.X, own.raw, np.eye(4), np.zeros(4))
    assert base == pytest.approx([3.0, 3.0, 2.0, 2.0])
