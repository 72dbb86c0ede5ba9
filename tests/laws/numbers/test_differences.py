"""What differs between logs: who has it, of which sign and size, and how sure that is."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.differences import (
    KINDS,
    Cause,
    Differences,
    Known,
    LogRows,
    pooled_values,
)
from identifiability.estimation.mixed_model import EVERYWHERE
from identifiability.estimation.noise import JointRuns

N, LOGS, NOISE = 300, 3, 0.05
ASKED = np.array([[0.0, 0.0, 1.0]])


def cause(kind, family, place, torque, before=np.nan, names=("x",)):
    return Cause(kind, family, place, names, ("1",) * len(names), torque, before)


def rows(seed, levels=(2.0, 2.0, 2.0), extra=None, offset=0.0, noise=NOISE):
    """Three logs of two joints: one column and friction of a level in each log, white noise."""
    rng = np.random.default_rng(seed)
    t, log = np.tile(np.arange(N) / 20.0, LOGS), np.repeat(np.arange(LOGS), N)
    smooth = np.stack([np.sin((1 + 0.3 * j) * t + log) + np.cos(2 * t + j) for j in range(2)], 1)
    sign = np.sign(np.cos(1.7 * t[:, None] + log[:, None] + [0.0, 1.0]))
    load = np.stack([smooth, smooth**2, sign * smooth, t[:, None] * smooth], axis=2)
    load = np.concatenate([load, 0.1 * rng.standard_normal((LOGS * N, 2, 6))], axis=2)
    y = 3.0 * smooth + 2.0 * sign
    y[:, 0] += (np.array(levels)[log] - 2.0) * sign[:, 0]
    y[:, 1] += offset * ASKED[0, log]
    y = y + noise * rng.standard_normal(y.shape)
    y = y if extra is None else y + ASKED[0, log][:, None] * (load @ extra)
    causes = [cause("load", "payload", "tool", {j: load[:, j] for j in range(2)}, names=KINDS)]
    for j in range(2):
        causes += [
            cause("friction", "Coulomb friction", f"j{j}", {j: sign[:, [j]]}, 2.0),
            cause("offset", "torque offset", f"j{j}", {j: np.ones((len(t), 1))}),
        ]
    runs = tuple((k * N, (k + 1) * N) for k in range(LOGS))
    X = np.zeros((len(t), 2, 4))
    for j in range(2):
        X[:, j, j], X[:, j, 2 + j] = smooth[:, j], sign[:, j]
    return LogRows(
        X=X,
        y=y,
        size=np.sqrt((y**2).mean(0)),
        runs=JointRuns((runs, runs)),
        log=log,
        less=np.full(len(t), -1),
        causes=tuple(causes),
    )


FREE = Known.nothing(np.eye(4), np.zeros(4))


def differences(own, patterns=(ASKED,), **more):
    return Differences(rows=own, known=FREE, patterns=patterns, **more)


def named(found):
    terms = found.model.search()
    return {(*[cause.family for cause in found.told(t)[0][:1]], t.group.place) for t in terms}


def test_logs_that_drift_by_three_percent_are_unchanged():
    assert named(differences(rows(0))) == set()
    assert named(differences(rows(1, levels=(2.04, 1.97, 2.0)))) == set()


def test_what_is_in_the_logs_asked_about_is_named_with_sign_and_size():
    found = differences(rows(2, levels=(2.0, 2.0, 1.2), offset=0.3))
    assert named(found) == {("Coulomb friction", "j0"), ("torque offset", "j1")}
    terms = found.model.search()
    columns, value, covariance = found.model.values(terms)
    for term in terms:
        k = list(columns).index(term.columns[0])
        true = 0.3 if "offset" in term.group.family else -0.8
        assert value[k] == pytest.approx(true, abs=4 * np.sqrt(covariance[k, k]))


def test_of_three_logs_the_odd_one_is_found_and_costs_more():
    single = tuple(np.eye(LOGS)[:2, None])
    found = differences(rows(3, levels=(2.0, 2.6, 2.0)), (ASKED, *single))
    (term,) = found.model.search()
    assert found.told(term)[1] == 2
    prices = {group.pattern: group.price for group in found.model.groups if group.causes}
    assert prices[1] == pytest.approx(prices[0] + np.log(2.0))


def test_families_and_places_share_the_prior_odds():
    found = differences(rows(4))
    total = sum(np.exp(-group.price) for group in found.model.groups)
    assert total == pytest.approx(1.0)
    assert ("Coulomb friction, 0", EVERYWHERE) in {group.key for group in found.model.groups}


def test_values_that_are_known_count_as_observations():
    own, M = rows(5), np.eye(4)
    truth = np.array([3.0, 3.0, 2.0, 2.0])
    plain = differences(own)
    _, value, covariance = plain.model.values()
    sure = Known.of(truth, M, 1e-12 * np.eye(4), np.zeros((4, 0)))
    vague = Known.of(truth + 0.1, M, 1e6 * np.eye(4), np.zeros((4, 0)))
    held, open_ = (replace(plain, known=known) for known in (sure, vague))
    moved = held.known.directions @ held.model.values()[1][:4]
    assert np.abs(moved).max() < 1e-5
    found = open_.known.base + open_.known.directions @ open_.model.values()[1][:4]
    assert found == pytest.approx(value[:4], abs=0.02 * np.sqrt(covariance[0, 0]) + 1e-6)


def test_each_log_counts_by_its_own_noise():
    own = rows(6)
    loud = own.y + 12 * NOISE * np.random.default_rng(6).standard_normal(own.y.shape) * (
        own.log == 1
    )[:, None]  # fmt: skip
    before, after = (
        np.sqrt(np.diag(differences(replace(own, y=y)).model.values()[2])[:4])
        for y in (own.y, loud)
    )
    assert (after < 1.5 * before).all()  # of two logs of three


def test_what_logs_of_one_motion_differ_by_has_nothing_of_the_rest():
    """A function of the motion cancels, the sign is that of later less earlier."""
    pair, rng = rows(7), np.random.default_rng(8)
    friction = pair.causes[1].torque[0] * [1.0, 0.0]
    y = 0.5 * friction + NOISE * rng.standard_normal(pair.y.shape)
    log, less = np.full(len(y), 2), np.zeros(len(y), int)
    found = differences(replace(pair, X=0.0 * pair.X, y=y, log=log, less=less))
    (term,) = found.model.search()
    assert term.group.place == "j0"
    _, value, _ = found.model.values((term,))
    assert value[-1] == pytest.approx(0.5, abs=0.05)


def test_rows_that_share_a_log_know_less():
    own = rows(9)
    once, twice = (differences(own, shared=shared).model.values()[2][0, 0] for shared in (1, 2))
    assert twice == pytest.approx(2 * once, rel=0.2)


def test_pooled_values_are_those_of_all_rows():
    own = rows(10, noise=0.0)
    base = pooled_values(own.X, own.y, np.eye(4), np.zeros(4))
    assert base == pytest.approx([3.0, 3.0, 2.0, 2.0])
