"""What a model leaves out goes into what it keeps: by how much, into what, and who is told."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Thresholds
from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.fit import LeftOut, ScoreScatter, body_scatter, find_left_out
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.verdict import judge
from identifiability.foundation.names import GROUPED_KINDS
from identifiability.foundation.rounding import REACH
from identifiability.regression.reduction import Submodel

from .made import fit_known, fit_of, gather

NAMES = (*(f"body.{k}" for k in GROUPED_KINDS), "joint.Fv", "joint.Fc")
FILE = np.array([2.0, 0.1, 0.2, 1.5, 0.1, 1.1, 0.6, 0.3, 0.1, 4.0, 5.0, 7.0])


def structure_of(nominal, names=NAMES):
    """Return a robot of one body and a joint with friction, every parameter a base parameter."""
    return SimpleNamespace(
        nominal=nominal,
        nominal_base=nominal,
        G=np.eye(12),
        columns=names,
        inertial=np.arange(10)[None],
        base=SimpleNamespace(names=names),
    )


def submodel_of(kept, fixed=None):
    kept = list(kept)
    names = tuple(NAMES[k] for k in kept)
    fixed = np.zeros(12) if fixed is None else fixed
    signs = np.zeros(len(kept), bool)
    return Submodel("small", "", names, names, ("",) * len(kept), np.eye(12)[:, kept], fixed, signs)


@pytest.fixture(scope="module")
def motion():
    rng = default_rng(0)
    return rng.normal(size=(400, 2, 12)) @ rng.normal(size=(12, 12))


def left_out(motion, nominal, submodel, tau=None):
    """Return what is left out, and the fit, of the torque of the file's robot by default."""
    tau = motion @ nominal if tau is None else tau
    every = gather(motion, tau, columns=NAMES)
    fit = find_estimator("ols").fit(submodel.reduce(every))
    return find_left_out(structure_of(nominal), submodel, every, fit), fit


def test_bodies_scatter_by_mass_and_the_rms_distance_of_their_mass():
    scatter = body_scatter(structure_of(FILE))
    mass = 4.0
    second = (2.0 + 1.5 + 1.1) / 2
    assert_allclose(scatter[9], ESTIMATION_RULES.body_share * mass)
    assert_allclose(scatter[6:9], ESTIMATION_RULES.body_share * np.sqrt(mass * second))  # m r
    assert_allclose(scatter[:6], ESTIMATION_RULES.body_share * second)
    assert not scatter[10:].any()


def test_what_the_fit_would_find_on_the_files_robot_is_what_it_finds_there(motion):
    found, fit = left_out(motion, FILE, submodel_of([0, 5, 9, 10]))
    assert_allclose(found.projected, fit.value, rtol=1e-8)


def test_sigma_is_the_rms_distance_of_noise_free_fits_from_their_labels(motion):
    kept = [0, 5, 9, 10]
    submodel = submodel_of(kept)
    found, _ = left_out(motion, FILE, submodel)
    flat = motion.reshape(-1, 12)
    draws = FILE + body_scatter(structure_of(FILE)) * default_rng(1).standard_normal((4000, 12))
    fits = np.linalg.lstsq(flat[:, kept], flat @ draws.T, rcond=None)[0].T
    rms = np.sqrt(np.mean((fits - draws[:, kept]) ** 2, axis=0))
    assert_allclose(found.sigma, rms, rtol=0.06)  # 4 Monte-Carlo errors of an sd


def test_nothing_left_out_nothing_added(motion):
    found, _ = left_out(motion, FILE, submodel_of(range(12)))
    assert not found.sigma.any()
    assert not any(found.stands_for)
    assert not found.unknown


def test_what_is_held_at_the_files_value_errs_by_its_scatter_alone(motion):
    fixed = np.where(np.isin(np.arange(12), [10, 11]), FILE, 0.0)
    found, _ = left_out(motion, FILE, submodel_of(range(10), fixed))
    assert_allclose(found.sigma, 0.0, atol=1e-9)  # friction does not scatter


def test_a_file_without_inertias_says_that_nothing_is_known(motion):
    nothing = np.where(np.arange(12) < 10, 0.0, FILE)
    found, _ = left_out(motion, nothing, submodel_of([0, 5, 9, 10]), motion @ FILE)
    assert found.unknown
    whole, _ = left_out(motion, nothing, submodel_of(range(12)), motion @ FILE)
    assert not whole.unknown


def test_the_largest_of_what_a_number_stands_for_is_named():
    W = default_rng(2).normal(size=(400, 1, 12))
    W[:, 0, 9] += 0.5 * W[:, 0, 0]  # a mass that moves with an inertia
    found, _ = left_out(W, FILE, submodel_of([0, *range(1, 9), 10, 11]))
    coefficient = np.linalg.lstsq(W[:, 0, [0, *range(1, 9), 10, 11]], W[:, 0, 9], rcond=None)[0][0]
    assert found.stands_for[0] == f"body.Ixx + {coefficient:.2g}·body.m"


def verdict_of(left):
    fit = fit_of([1.0], [0.01])
    scores = ScoreScatter(np.array([0.01]), np.array([1e9]))
    found = fit_known(fit, scores, noise=100.0, left_out=left)
    told = ["p"], ["kg"], 1.0, ("",), np.zeros(1, bool), np.array([1.1])
    (verdict,) = judge(found, *told, Thresholds())
    return verdict


def out(sigma, *, unknown=False, disputed=np.nan):
    return LeftOut(
        sigma=np.array([sigma]),
        projected=np.array([1.05]),
        stands_for=("p + 0.5·q",),
        unknown=unknown,
        disputed=np.array([disputed]),
    )


def test_the_interval_of_the_label_and_the_verdict_know_what_is_left_out():
    sure = verdict_of(out(0.1))
    assert sure.verdict == "identifiable"
    assert_allclose(np.diff(sure.interval95), 2 * 1.96 * np.hypot(0.01, 0.1), rtol=1e-4)
    assert_allclose(np.diff(sure.data_interval95), 2 * 1.96 * 0.01, rtol=1e-4)
    assert "p + 0.5·q, known to ±1 %" in sure.reason
    assert (sure.terms["omitted"], sure.projected, sure.nominal) == (0.1, 1.05, 1.1)
    assert verdict_of(out(0.3)).verdict == "sign only"
    assert verdict_of(out(2.0)).verdict == "not identifiable"


def test_a_verdict_says_what_nobody_knows_and_what_the_unpruned_model_finds_instead():
    assert "states no inertias" in verdict_of(out(0.0, unknown=True)).reason
    assert "unpruned model puts it at 4.2: " in verdict_of(out(0.1, disputed=4.2)).reason
    little = verdict_of(out(0.004)).reason
    assert not any(words in little for words in ("stands for", "states no", "puts it at"))


def quiet(motion, size=1e-6):
    return size * default_rng(0).standard_normal(motion.shape[:2])


def known_by_logs(motion, submodel, theta, noise, file=FILE, names=NAMES):
    """Return what is left out where logs are asked too, the fit, and that of all parameters."""
    every = gather(motion, motion @ theta + noise, columns=NAMES)
    fit, full = (find_estimator("ols").fit(i) for i in (submodel.reduce(every), every))
    return find_left_out(structure_of(file, names), submodel, every, fit, full), fit, full


def test_an_offset_that_is_left_out_counts_as_far_as_the_logs_show_it(motion):
    file = np.append(FILE[:11], 0.0)
    theta = np.append(FILE[:11], 1.0)
    given = submodel_of(range(11)), theta, quiet(motion), file, (*NAMES[:11], "joint.off")
    found, fit, _ = known_by_logs(motion, *given)
    assert_allclose(found.sigma, np.abs(fit.value - theta[:11]), rtol=1e-4)


@pytest.mark.parametrize("size", [1e-6, 0.3])
def test_what_no_file_states_is_noticed_by_the_unpruned_model(motion, size):
    """Friction far from the file's is left out: its scatter is zero, but the logs know better."""
    kept = [0, 5, 9]
    theta = FILE + np.where(np.arange(12) == 10, 40.0, 0.0)
    fixed = np.where(np.isin(np.arange(12), kept), 0.5 * FILE, 0.0)
    submodel = submodel_of(kept, fixed)
    found, fit, full = known_by_logs(motion, submodel, theta, quiet(motion, size=size))
    label = (full.value - fixed)[kept]
    apart = np.abs(fit.value - label)
    own = REACH * full.sigma[kept] * np.sqrt(full.times.max())
    # The interval of the label holds that of the unpruned model, and so the truth.
    reach = REACH * found.sigma
    assert (reach >= np.abs(fit.value - (theta - fixed)[kept])).all()
    told = np.isfinite(found.disputed)
    assert told.any()
    assert_allclose(reach[told], (apart + own)[told], rtol=1e-6)
    assert_allclose(found.disputed[told], label[told])


def test_a_label_that_the_unpruned_model_leaves_open_is_not_disputed(motion):
    submodel = submodel_of([0, 5, 9, 10, 11])
    theta = FILE + np.where(np.arange(12) == 3, 40.0, 0.0)
    found = known_by_logs(motion, submodel, theta, quiet(motion, size=1e7))[0]
    assert np.isnan(found.disputed).all()


def test_logs_that_tell_all_leave_the_distance_from_the_label_itself(motion):
    kept = [0, 5, 9, 10]
    theta = FILE + body_scatter(structure_of(FILE)) * default_rng(3).standard_normal(12)
    found, fit, _ = known_by_logs(motion, submodel_of(kept), theta, quiet(motion))
    assert_allclose(found.sigma, np.abs(fit.value - theta[kept]), rtol=1e-4)


def test_logs_that_tell_nothing_leave_what_the_file_knows(motion):
    kept = [0, 5, 9, 10, 11]
    found = known_by_logs(motion, submodel_of(kept), FILE, quiet(motion, size=1e7))[0]
    alone, _ = left_out(motion, FILE, submodel_of(kept))
    assert_allclose(found.sigma, alone.sigma, rtol=1e-3)


def test_sigma_is_the_rms_distance_whatever_the_noise_and_follows_the_robot():
    """Robots drawn as the file allows, logs of them with noise that leaves some things open."""
    rng = default_rng(4)
    kept = [0, 5, 9, 10]
    size = 5.0
    W = rng.normal(size=(60, 2, 12)) @ rng.normal(size=(12, 12))
    submodel = submodel_of(kept)
    P = np.linalg.pinv(W.reshape(-1, 12)[:, kept])
    noise_variance = size**2 * (P**2).sum(1)
    squares = []
    said = []
    for _ in range(60):
        theta = FILE + body_scatter(structure_of(FILE)) * rng.standard_normal(12)
        noise = size * rng.standard_normal(W.shape[:2])
        found, fit, _ = known_by_logs(W, submodel, theta, noise)
        squares.append((fit.value - theta[kept]) ** 2)
        said.append(found.sigma**2 + noise_variance)
    error = np.std(np.array(squares) - said, axis=0) / np.sqrt(60)
    assert (np.abs(np.mean(squares, 0) - np.mean(said, 0)) < 4 * error).all()
    # The logs tell which robots are far from their label.
    order = np.argsort(said, axis=0)
    near, far = (np.take_along_axis(np.array(squares), o, 0) for o in (order[:30], order[30:]))
    assert (near.mean(0) < 0.8 * far.mean(0)).all()
