"""One mixed model: its algebra against dense matrices, and what it names in drawn logs."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal, norm

from identifiability import Log, prepare_log
from identifiability.effects import find_families
from identifiability.effects.friction import REVERSALS
from identifiability.estimation.groups import Missing, with_reversals
from identifiability.estimation.mixed_model import (
    EVERYWHERE,
    SIZES,
    Group,
    MixedModel,
    Term,
    one_of,
    whitened_information,
    without,
)
from identifiability.estimation.noise import JointNoise, JointRuns, split_runs, whiten
from identifiability.estimation.search import find_missing
from identifiability.regression.reduction import default_ladder, ladder_model
from identifiability.regression.structure import Structure
from identifiability.robot.servo import Servo
from identifiability.simulation.simulator import ar1
from identifiability.workflows.analyze.workflow import say_delays

from ..conftest import shipped_log

N, FIXED, RANDOM = 60, 3, 5
PACF, SIGMA = (np.array([0.6]), np.array([0.5, -0.3])), (0.7, 1.3)
#: Stretches of both joints: rows between them are no data.
RUNS = JointRuns((((0, 20), (23, 41), (41, 60)), ((2, 30), (31, 58))))


NOISE = tuple(map(JointNoise, PACF, SIGMA))


def draw_rows(seed):
    rng = default_rng(seed)
    Z = rng.standard_normal((N, 2, FIXED + RANDOM))
    Z[:, 0, -1] = 0.0  # a column that acts in one joint alone
    return Z, rng.standard_normal((N, 2))


def products_of(Z, y, runs=RUNS, edges=(0, 23, N)):
    width = Z.shape[2]
    columns = []
    rows = []
    for j in range(2):
        act = np.flatnonzero(Z[:, j].any(0))
        columns.append(np.append(act, width))
        rows.append(np.column_stack([Z[:, j, act], y[:, j]]))
    return whitened_information(columns, rows, NOISE, runs, edges)


GROUPS = (
    Group("a", "1", (np.array([3]), np.array([4]), np.array([3, 4])), 1.0, positive=True),
    Group("a", "2", (np.array([5, 6]),), 2.0),
    Group("b", "1", (np.array([7]),), 2.0),
)


def model_of(products):
    scale = np.array([1.0, 1.0, 1.0, 0.5, 2.0, 1.0, 3.0, 1.0])
    return MixedModel(products, FIXED, GROUPS, scale)


def dense(Z, y, runs=RUNS):
    """Rows that are data, and the covariance of their noise."""
    rows = []
    values = []
    blocks = []
    for j, own in enumerate(runs):
        for a, b in own:
            rows.append(Z[a:b, j])
            values.append(y[a:b, j])
            A = whiten(np.eye(b - a), [(0, b - a)], PACF[j])
            blocks.append(SIGMA[j] ** 2 * np.linalg.inv(A.T @ A))
    return np.concatenate(rows), np.concatenate(values), block_diag(*blocks)


def spread(model, A, term):
    """Return the covariance that a term adds to rows."""
    Z = A[:, term.columns] / model.scale[term.columns]
    return term.variance * Z @ Z.T


def restricted(X, y, V):
    """Log-likelihood of what is left beside X, with X integrated out."""
    W = np.linalg.inv(V)
    XWX = X.T @ W @ X
    left = y - X @ np.linalg.solve(XWX, X.T @ W @ y)
    dets = np.linalg.slogdet(V)[1] + np.linalg.slogdet(XWX)[1]
    return -0.5 * (dets + left @ W @ left)


@pytest.fixture(scope="module")
def rows():
    return draw_rows(1)


def test_solving_is_generalised_least_squares_under_the_marginal_covariance(rows):
    model, (A, y, V) = model_of(products_of(*rows)), dense(*rows)
    terms = (Term(GROUPS[0], 2, 0.3, 0.0), Term(GROUPS[1], 0, 0.05, 0.0))
    X = A[:, :FIXED]
    whole = V + sum(spread(model, A, t) for t in terms)
    W = np.linalg.inv(whole)
    covariance = np.linalg.inv(X.T @ W @ X)
    s = model.solve(terms)
    bare = model.solve()
    assert_allclose(s.value[:FIXED], covariance @ X.T @ W @ y, rtol=1e-6)
    assert_allclose(s.covariance[:FIXED, :FIXED], covariance, rtol=1e-6)
    gain = restricted(X, y, whole) - restricted(X, y, V)
    assert s.log_likelihood - bare.log_likelihood == pytest.approx(gain, rel=1e-6)


def test_gains_are_marginal_likelihoods_averaged_over_shapes_sizes_and_signs(rows):
    """By brute force, beside a term; the sign of a curve is that of the likeliest of its shapes."""
    model, (A, y, V) = model_of(products_of(*rows)), dense(*rows)
    beside = Term(GROUPS[2], 0, 0.2, 0.0)
    V = V + spread(model, A, beside)
    X = A[:, :FIXED]
    bare = restricted(X, y, V)
    for found in model.gains((beside,)):
        group = found.group
        odds, signs = np.zeros((2, len(group.members), len(SIZES)))
        for i, at in enumerate(group.members):
            Z = A[:, at] / model.scale[at]
            for k, size in enumerate(SIZES):
                whole = V + size**2 * Z @ Z.T
                odds[i, k] = np.exp(restricted(X, y, whole) - bare)
                W = np.linalg.inv(whole)
                P = W - W @ X @ np.linalg.solve(X.T @ W @ X, X.T @ W)
                u = size**2 * Z.T @ P @ y
                C = size**2 * np.eye(len(at)) - size**4 * Z.T @ P @ Z
                signs[i, k] = 2 * norm.cdf(u.sum() / np.sqrt(C.sum()))
        if group.positive:
            signs[2] = signs[np.argmax(odds[:2].max(1))]
            odds *= signs
        assert found.odds == pytest.approx(np.log(odds.mean()) - group.price, abs=1e-4)


def test_one_solution_tells_the_odds_of_each_term_given_the_others(rows):
    model = model_of(products_of(*rows))
    terms = tuple(Term(g, 0, 0.3, 0.0) for g in GROUPS)
    each = [model.gains(without(terms, k), [g])[0].odds for k, g in enumerate(GROUPS)]
    assert_allclose(model.odds_each(terms), each)


def test_products_add_up_over_blocks(rows):
    whole = products_of(*rows)
    every = np.arange(whole.size + 1)
    halves = sum(whole.take(np.array([k])).between(every[:, None], every) for k in (0, 1))
    assert_allclose(halves, whole.between(every[:, None], every))


def test_evidence_is_the_density_of_unseen_rows_given_fitted_ones(rows):
    """Against the predictive distribution of rows that are independent of the fitted ones."""
    model = model_of(products_of(*rows))
    term = (Term(GROUPS[1], 0, 0.3, 0.0),)
    unseen = draw_rows(2)
    new = products_of(*unseen, edges=(0, N))
    A, y, V = dense(*unseen)
    logs = []
    for terms in ((), term):
        s = model.solve(terms)
        B = A[:, s.columns] / model.scale[s.columns]
        logs.append(multivariate_normal(B @ s.value, B @ s.covariance @ B.T + V).logpdf(y))
    (gain,) = model.news(term, new)
    assert gain == pytest.approx(logs[1] - logs[0], rel=1e-5)


def test_a_function_of_two_effects_gives_way_to_both(rows):
    """It explains more than either. Given the second, the first is the simpler name."""
    Z, y = (x.copy() for x in rows)
    Z[..., 5] = Z[..., 3]
    Z[..., 6] += 3.0 * Z[..., 4]
    y += 3.0 * (Z[..., 3] + Z[..., 4])
    members = [3], [4], [5, 6]
    groups = tuple(Group(str(at), "1", (np.array(at),), 1.0) for at in members)
    model = MixedModel(products_of(Z, y), FIXED, groups, np.full(8, 0.2))
    assert model.gains()[0].group is groups[2]
    assert {t.group for t in model.search()} == set(groups[:2])


# Drawn logs: what is named where nothing is missing, and where something is.


@pytest.fixture(scope="module")
def arm(two_link):
    frame = shipped_log(two_link, "a", 900).to_frame()
    structure = Structure.of(two_link, ladder_model(default_ladder(two_link)))
    return two_link, frame, structure


def drawn(arm, seed, rho, effect=None, until=1.0):
    """Return the regression of a drawn log with noise of 3 %, and an effect in its first part."""
    robot, frame, structure = arm
    f = frame.copy()
    for k, joint in enumerate(robot.joints):
        sd = 0.03 * frame[f"{joint}.tau"].std()
        f[f"{joint}.tau"] += sd * ar1((len(f), 1), rho, default_rng([seed, k]))[:, 0]
    if effect:
        joint, size, curve = effect
        x = curve(*(frame[f"{joint}.{k}"].to_numpy() for k in ("q", "dq", "tau")))
        sd = 0.03 * frame[f"{joint}.tau"].std()
        acts = np.arange(len(f)) < until * len(f)
        f[f"{joint}.tau"] += size * sd * acts * x / np.sqrt(np.mean(x**2))
    return structure.regression([prepare_log(robot, Log.from_frame(f, "a"))])


def missing_in(arm, seed, rho, effect=None, gone=0.0):
    """What may be missing in a drawn log, of which some rows are gone."""
    found = Missing.of(drawn(arm, seed, rho, effect), find_families(None), arm[2].present)
    if gone:
        data = found.seen.data.copy()
        length = int(gone * len(data) / 20)
        for a in default_rng(seed).integers(len(data) - length, size=20):
            data[a : a + length] = False
        X, y = found.seen.X * data[:, :, None], found.seen.y * data
        runs = split_runs(found.seen.runs[0], data)
        found = replace(found, seen=replace(found.seen, X=X, y=y, data=data, runs=runs))
    return found


def test_groups_share_one_prior_and_columns_are_as_large_as_torque(arm):
    found = missing_in(arm, 3, 0.6, gone=0.3)
    assert sum(np.exp(-g.price) for g in found.groups) == pytest.approx(1.0)
    reversals = {g.key for g in found.groups} - {g.key for g in found.model().groups}
    assert {name for name, _ in reversals} == {REVERSALS.name}
    assert with_reversals(arm[0], (), ()) == ()
    torque = np.linalg.norm(found.seen.raw * found.seen.data, axis=0)
    acts = found.entries
    for (j, _), x in acts.items():
        assert not x[~found.seen.data[:, j]].any()
    for c in found.candidates:
        own = [x for x in acts if x[1] in c.columns]
        if c.family.flexible and not c.family.pairs:
            assert np.ptp(found.scale[list(c.columns)]) == 0.0
        elif len(own) == len(c.columns) == 1:
            [(j, k)] = own
            assert np.linalg.norm(acts[j, k]) / found.scale[k] == pytest.approx(torque[j])
    curves = [g for g in found.groups if found.sets[g.key][0][0].family.continuous]
    assert any(len(found.sets[g.key]) > 1 for g in curves)
    for g in curves:
        shapes = len(found.sets[g.key])
        assert len(g.members) == shapes + (shapes > 1)
    between = found.between_reversals()
    assert (between.between_reversals().seen.data == between.seen.data).all()


@pytest.mark.parametrize("rho, gone", [(0.6, 0.3), (0.9, 0.0), (0.98, 0.0), (0.98, 0.3)])
def test_where_nothing_is_missing_nothing_is_named(arm, rho, gone):
    """Whatever the memory of the noise, and with 30 % of the rows missing in 20 stretches."""
    named = [missing_in(arm, seed, rho, gone=gone).model().search() for seed in range(20, 23)]
    assert [n for n in named if n] == []


CURVES = {
    "stribeck_friction": lambda q, v, tau: np.sign(v) * np.exp(-np.abs(v) / 0.15 / np.std(v)),
    "quadratic_friction": lambda q, v, tau: v * np.abs(v),
    "joint_stiffness": lambda q, v, tau: q,
    "position_torque": lambda q, v, tau: np.sin(5.0 * q),
}


@pytest.mark.parametrize("name", CURVES)
def test_what_is_planted_is_named_in_its_joint_alone_and_confirmed(arm, name):
    effect = "elbow", 3.0, CURVES[name]
    found = missing_in(arm, 3, 0.6, effect)
    model = found.model()
    unseen = found.products(missing_in(arm, 4, 0.6, effect).seen)
    terms = model.confirm(model.search(), unseen)
    assert {t.group.place for t in terms} == {"elbow"}
    rivals = [r.key[0] for t in range(len(terms)) for r in model.rivals(terms, t)]
    assert name in [*(t.key[0] for t in terms), *rivals]


def test_the_sign_that_physics_forbids_names_the_opposite(arm):
    effect = "elbow", 3.0, lambda q, v, tau: -CURVES["stribeck_friction"](q, v, tau)
    model = missing_in(arm, 3, 0.6, effect).model()
    names = [t.key[0] for t in model.search()]
    assert "stribeck_friction" not in names
    assert {"rising_friction", "sigmoid_friction"} & set(names)


def test_what_is_in_every_joint_is_named_as_that(arm):
    robot, frame, structure = arm
    changed = frame.copy()
    for joint in robot.joints:
        v = frame[f"{joint}.dq"]
        changed[f"{joint}.tau"] += 0.1 * frame[f"{joint}.tau"].std() * v * np.abs(v) / v.std() ** 2
    model = missing_in((robot, changed, structure), 3, 0.3).model()
    terms = model.search()
    assert ("quadratic_friction", EVERYWHERE) in [t.key for t in terms]
    assert "quadratic_friction" not in {g.family for g in model.beside(terms)}
    assert one_of([0.0]) == [0.5]  # or none is there


@pytest.mark.parametrize("until, play", [(1.0, ""), (0.7, ""), (1.0, "shoulder")])
def test_what_the_last_part_lacks_or_play_is_beside_is_not_named(arm, until, play):
    effect = "elbow", 3.0, CURVES["quadratic_friction"]
    named = find_missing(arm[2], drawn(arm, 3, 0.6, effect, until), play=[play]).named
    found = "quadratic_friction" in {t.group.family for t in named}
    assert found == (until == 1.0 and not play)


@pytest.mark.parametrize("late, refuted", [(False, False), (True, False), (True, True)])
def test_commands_are_late_beyond_unknown_ages_unless_rollouts_refute_it(arm, late, refuted):
    one = np.ones(2)
    robot = replace(arm[0], servo=Servo(one, one, -one, one, rate=10.0))
    structure = Structure.of(robot, arm[2].model)
    effect = "elbow", 5 + 45 * late, lambda q, v, tau: np.gradient(tau)
    log = drawn((robot, arm[1], structure), 3, 0.6, effect)
    # Each joint is late by 0 ± 1 ms.
    rolled = np.diag([1e3, 1e3, 1.0]) if refuted else None
    missing = find_missing(structure, log, commanded=True, own_delays=rolled)
    assert bool(missing.named) == late
    assert bool([*say_delays(robot, missing)]) == (late > refuted)
    assert refuted <= all(s.term.group.family != "command_delay" for s in missing.shares)


def test_weights_of_rows_multiply_products():
    Z, y = draw_rows(5)
    whole = products_of(Z, y)
    weights = np.array([4.0, 0.25])
    every = np.arange(FIXED + RANDOM + 1)
    root = np.sqrt(weights)
    heavier = products_of(Z * root[:, None], y * root)
    found = whole.weigh(weights[:, None]).between(every[:, None], every)
    assert_allclose(found, heavier.between(every[:, None], every), atol=1e-12)
