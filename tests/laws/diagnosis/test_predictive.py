"""How likely unseen motion is given the fitted one, against normal densities in full."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from identifiability.estimation.evidence import choose_folds
from identifiability.workflows.diagnose.predictive import Predictive

#: Prior standard deviation that says nothing beside these rows, yet leaves a density its digits.
WIDE = 1e3


@pytest.fixture
def rng():
    return np.random.default_rng(21)


def make(rng, hidden=0.0, off=0.0, fitted=60, unseen=40, noise=1.0):
    """Fitted and unseen rows of two base columns, one effect and torque, in units of the noise.

    The fitted motion hardly moves the second base column, by which the unseen one moves a lot.
    """
    columns = rng.standard_normal((fitted + unseen, 3)) * [1.0, 1.0, 0.6]
    columns[:fitted, 1] = 0.05 * columns[:fitted, 1] + 0.05 * columns[:fitted, 2]
    e = noise * rng.standard_normal(fitted + unseen)
    torque = columns @ [3.0, 2.0, hidden] + e
    torque[fitted:] += off * rng.standard_normal(unseen)
    rows = np.column_stack([columns, torque])
    return rows[:fitted], rows[fitted:]


def density(rows, columns):
    """Log density of the torque of some rows, values of some columns having a wide prior."""
    X = rows[:, columns]
    return stats.multivariate_normal(cov=np.eye(len(rows)) + WIDE**2 * X @ X.T).logpdf(rows[:, -1])


def predictive_of(fitted, unseen):
    return Predictive.of([(fitted, unseen)], len(unseen))


def test_evidence_is_the_ratio_of_predictive_densities(rng):
    for hidden in (0.0, 1.0):
        fitted, unseen = make(rng, hidden)
        both = np.concatenate([fitted, unseen])
        with_it, without = (density(both, c) - density(fitted, c) for c in ([0, 1, 2], [0, 1]))
        of = predictive_of(fitted, unseen)
        scale = max(1.0, of.left / len(unseen))
        narrowed = of.of_effect([2]).evidence * scale - (with_it - without)
        # What the unseen motion narrows the values by is no square, and no noise makes it less.
        X, y = both[:, :3], fitted[:, :3]
        freedom = 0.5 * (np.linalg.slogdet(X.T @ X)[1] - np.linalg.slogdet(y.T @ y)[1])
        X, y = both[:, :2], fitted[:, :2]
        freedom -= 0.5 * (np.linalg.slogdet(X.T @ X)[1] - np.linalg.slogdet(y.T @ y)[1])
        assert narrowed == pytest.approx(freedom * (1 - scale), abs=1e-3)


def test_of_noise_the_ratio_is_one_in_the_mean_whatever_the_base_values_are(rng):
    """Noise as it is said to be; unseen motion that tells little of the effect, whose ratio has a
    spread that is counted in few draws.
    """
    fitted, unseen = make(rng, fitted=60, unseen=2000)
    fitted[:, 2] *= 8.0
    unseen[:, 2] *= 0.4
    found = []
    for noise in rng.standard_normal((4000, 2060)):
        own = [np.column_stack([rows[:, :3], rows[:, :2] @ [3.0, 2.0] + e])
               for rows, e in ((fitted, noise[:60]), (unseen, noise[60:]))]  # fmt: skip
        found.append(replace(predictive_of(*own), rows=10**9).of_effect([2]).evidence)
    ratio = np.exp(found)
    assert ratio.mean() == pytest.approx(1.0, abs=4 * ratio.std() / np.sqrt(len(ratio)))
    assert ratio.std() > 0.2


def test_an_effect_shows_beside_base_values_that_unseen_motion_finds_far_off(rng):
    """As fitted both models are far off there, and the fitted effect may well be further."""
    told, plain, covered, beyond = [], [], {0.0: 0, 1.0: 0}, 0
    for _ in range(300):
        fitted, unseen = make(rng, 1.0)
        of = predictive_of(fitted, unseen)
        told.append(of.of_effect([2]))
        beyond += not of.within_noise
        errors = []
        for columns in ([0, 1], [0, 1, 2]):
            value = np.linalg.lstsq(fitted[:, columns], fitted[:, -1])[0]
            errors.append(np.sum((unseen[:, -1] - unseen[:, columns] @ value) ** 2))
        plain.append(0.5 * (errors[0] - errors[1]))
        none = predictive_of(*(r - np.outer(r[:, 2], [0, 0, 0, 1]) for r in (fitted, unseen)))
        low, high = none.of_effect([2]).news
        covered[0.0] += low < 0 < high
        # As the fitted size has errors too, one is not where it lies: the size that is true is.
        R = np.linalg.qr(fitted[:, :3])[0].T @ fitted
        size = np.linalg.solve(R[:, :3], R[:, 3])[2]
        low, high = np.array(told[-1].news) * size
        covered[1.0] += min(low, high) < 1.0 < max(low, high)
    assert np.mean([t.evidence > 0 for t in told]) > np.mean(np.array(plain) > 0) + 0.1
    assert beyond <= 4
    # 99.9 % of counts of 300 with chance .95 or, where more than noise widens the interval, more.
    assert all(count >= 271 for count in covered.values())
    assert covered[0.0] <= 298


def test_noise_beyond_what_is_foretold_weakens_the_squares_and_is_told(rng):
    fitted, unseen = make(rng, 1.0, off=3.0, unseen=4000)
    of = predictive_of(fitted, unseen)
    assert not of.within_noise
    assert of.left / of.rows == pytest.approx(10.0, rel=0.1)
    quiet = replace(of, rows=10**9)
    assert quiet.within_noise
    narrowed = 0.5 * np.log(10.0)
    ratio = (of.of_effect([2]).evidence + narrowed) / (quiet.of_effect([2]).evidence + narrowed)
    assert ratio == pytest.approx(0.1, rel=0.3)
    assert np.ptp(of.of_effect([2]).news) == pytest.approx(
        np.sqrt(of.left / of.rows) * np.ptp(quiet.of_effect([2]).news)
    )


def test_units_and_directions_that_no_motion_moves_change_nothing(rng):
    fitted, unseen = make(rng, 1.0)
    told = predictive_of(fitted, unseen).of_effect([2])

    def same(change, own):
        found = predictive_of(*(change(rows) for rows in (fitted, unseen))).of_effect(own)
        assert found.evidence == pytest.approx(told.evidence, abs=1e-5)
        assert found.news == pytest.approx(told.news, abs=1e-5)

    same(lambda rows: rows * [1e9, 1e-9, 1e-12, 1.0], [2])
    same(lambda rows: rows[:, [2, 0, 1, 3]], [0])
    same(lambda rows: np.insert(rows, 1, 0.0, axis=1), [3])  # a base column of no motion at all
    same(lambda rows: np.insert(rows, 1, rows[:, 0], axis=1), [3])  # and one that is there twice
    same(lambda rows: np.insert(rows, 3, rows[:, 2], axis=1), [2, 3])  # so is the effect's
    nothing = predictive_of(fitted * [1, 1, 0, 1], unseen).of_effect([2])
    assert nothing.evidence == 0.0
    assert np.isnan(nothing.news).all()


def test_what_is_fitted_and_unseen_is_read_from_the_rows(world, candidate, rng):
    """Weighed by the noise; what is known beforehand is fitted too; and in turn without unseen."""
    columns, c = list(world.basis.T[:2]), [candidate("a", "j", 1)]
    rows, unseen = (world.make(rng.standard_normal(world.rows) + 4 * columns[1], columns)
                    for _ in range(2))  # fmt: skip
    noise = world.bench(rows, 1).noise
    held = replace(world.held(rows), verifying=unseen)

    def by_hand(*more):
        own = [np.column_stack([r.columns(c)[:, 0], r.tau]) for r in (rows, unseen)]
        return predictive_of(np.concatenate([own[0], *more]), own[1])

    def same(a, b):
        assert a.of_effect([1]).evidence == pytest.approx(b.of_effect([1]).evidence, abs=1e-6)
        assert (a.left, a.rows) == (pytest.approx(b.left), b.rows)

    same(held.predictive(c, noise), by_hand())
    root = np.array([[50.0]])
    known = replace(held, train=replace(rows, root=root))
    same(known.predictive(c, noise), by_hand(np.array([[50.0, 0.0, 0.0]])))
    folds, own = choose_folds(rows.log), np.column_stack([rows.columns(c)[:, 0], rows.tau])
    parts = [(own[folds != k], own[folds == k]) for k in np.unique(folds)]
    assert len(parts) > 1
    same(replace(held, verifying=None).predictive(c, noise), Predictive.of(parts, len(own)))
    # Values of both motions: what a model does not explain is white noise more.
    wrong = replace(unseen, tau=unseen.tau + 30.0 * rng.standard_normal(unseen.tau.shape))
    assert replace(held, verifying=wrong).predictive(c, noise).within_noise
