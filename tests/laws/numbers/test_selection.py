"""Which model is used: the smallest that may stand for the best, possible ones first."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.fit import column_noise, column_rms, merge_blocks
from identifiability.estimation.groups import NO_MISSING_EFFECTS, JointRows, MissingEffects, Share
from identifiability.estimation.prediction import Prediction
from identifiability.physical.feasibility import PhysicalResult
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.reduction import Submodel
from identifiability.report.answers.analyze import list_doubted
from identifiability.workflows.analyze.judge import assess_ladder, decide_model, select_model
from identifiability.workflows.analyze.ladder import LadderFit

from .made import gather


@dataclass
class Judged:
    """What selection asks of a model."""

    size: int
    error_ra_validation: float
    spread: float = 0.0
    feasible: bool = True
    infeasible: tuple[str, ...] = ()
    contradicted: str = ""

    @property
    def submodel(self):
        return range(self.size)


def choose(models, near=None):
    """Select among models of which folds of the fitted logs leave some."""
    return select_model(models, np.ones(len(models), bool) if near is None else np.array(near))


def test_the_smallest_model_that_folds_leave_is_used():
    models = [Judged(9, 0.100), Judged(7, 0.104, 0.005), Judged(5, 0.106, 0.005)]
    assert choose(models) == 2
    assert choose(models, [True, True, False]) == 1
    assert choose(models, [True, False, False]) == 0


def test_of_models_that_predict_as_well_one_that_a_real_robot_can_have_comes_first():
    models = [Judged(9, 0.1), Judged(5, 0.101, 0.01, False), Judged(3, 0.102, 0.01, False, ("m",))]
    assert choose(models) == 0
    models[0].feasible = False
    assert choose(models) == 1  # no forbidden sign, though no real robot
    models[0].infeasible = models[1].infeasible = ("m",)
    assert choose(models) == 2


def test_a_model_that_is_sure_of_something_impossible_comes_last():
    models = [Judged(9, 0.1), Judged(5, 0.1, 0.01, contradicted="m would be negative")]
    assert choose(models) == 0
    models[0].feasible, models[0].infeasible = False, ("m",)
    assert choose(models) == 0
    models[0].contradicted = "so would another"
    assert choose(models) == 1


def test_a_model_that_is_sure_of_something_impossible_says_so(ladder):
    *_, results = ladder
    assert results[0].contradicted == "b would have a sign that physics forbids"
    assert replace(results[0], infeasible=()).contradicted == ""


def test_possible_models_come_first_only_among_those_that_predict_as_well():
    assert choose([Judged(9, 0.1, 0.0, False), Judged(5, 0.1)], [True, False]) == 0


def test_without_errors_the_last_model_is_used():
    assert choose([Judged(9, np.nan), Judged(5, np.nan)]) == 1


# A ladder of two models, assessed from numbers alone


def submodel(name, kept, names, nonnegative=()):
    """Return the model of some of four columns."""
    M = np.eye(4)[:, kept]
    columns = tuple(names[k] for k in kept)
    return Submodel(
        name=name, description="", columns=columns, labels=columns, units=("kg",) * len(kept),
        M=M, fixed=np.zeros(4), nonnegative=np.isin(kept, nonnegative),
    )  # fmt: skip


def fitted_model(model, every, nominal):
    """Return a model fitted to information about all four columns, of which a file states some."""
    structure = SimpleNamespace(
        nominal_base=np.array(nominal),
        nominal=np.array(nominal),
        G=np.eye(4),
        columns=every.columns,
        parameters=(),
        robot=SimpleNamespace(joints=("one", "two")),
        inertial=np.empty((0, 10), int),
        base=SimpleNamespace(names=every.columns),
    )
    return FittedModel.of(structure, model, every, find_estimator("wls"))


@dataclass
class Physics:
    """What an assessment asks of physics."""

    margin: float
    as_good: bool = False
    value: np.ndarray | None = None
    base: np.ndarray | None = None
    within = PhysicalResult.within

    @property
    def feasible(self):
        return self.margin >= 0


@pytest.fixture(scope="module")
def ladder():
    rng = default_rng(0)
    W = rng.normal(size=(1920, 2, 4)) * [1.0, 2.0, 1.0, 1.0]
    W[:, :, 3] = W[:, :, 2]  # c and d are never told apart
    tau = W @ [1.0, -0.5, -0.3, 0.0] + rng.normal(size=(1920, 2)) * [0.1, 0.2]
    names = ("a", "b", "c", "d")
    every = gather(W, tau, columns=names)
    submodels = [submodel("full", [0, 1, 2, 3], names, [1, 2, 3]), submodel("small", [0], names)]
    models = [fitted_model(r, every, [1.0, 2.0, 3.0, 4.0]) for r in submodels]
    fits = [m.estimate for m in models]
    values = np.stack([r.expand(f.value) for r, f in zip(submodels, fits, strict=True)], 1)
    # "The nearest real robots", and "what files of both formats hold", of them and as stated.
    shares = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)
    values = np.stack([share * values[:, k] for k in range(2) for share in shares], axis=1)
    half = [slice(0, 960), slice(960, 1920)]
    made = [
        Prediction.of([np.arange(960.0)], tau[h], W[h] @ values, np.zeros(960, int)) for h in half
    ]
    rng = default_rng(0)
    physics = [Physics(0.1), Physics(-0.1)]
    pairs = zip(models, physics, strict=True)
    ladder_fits = [LadderFit(model, real, None, None, np.empty(0)) for model, real in pairs]
    found = SimpleNamespace(fits=ladder_fits, fitted=made[0], unseen=made[1], shared=None)
    results = assess_ladder(found, rng, 50, NO_MISSING_EFFECTS)
    return W, tau, every, fits, made, results


def test_every_model_gets_its_own_errors(ladder):
    *_, made, results = ladder
    fitted, fixed = (p.relative_error() for p in made)
    for k, r in enumerate(results):
        assert (r.error_ra, r.error_ra_validation) == (fitted[6 * k], fixed[6 * k])
        assert [r.unseen_by(of) for of in range(6)] == fixed[6 * k : 6 * k + 6].tolist()
        assert r.fitted.relative_error().tolist() == fitted[6 * k : 6 * k + 6].tolist()


def test_the_values_to_use_are_the_real_robots_where_it_predicts_as_well(ladder):
    *_, fits, made, results = ladder
    small, (own,) = results[1], fits[1].value
    base = np.array([0.9 * own, 0.0, 2.0, 0.0])  # its bodies cannot do without c
    real = Physics(-0.1, as_good=True, value=np.array([0.9 * own]), base=base)
    used = replace(small, physical=real)
    assert used.physical_used
    assert used.recommended == [0.9 * own]
    assert used.real.expand(used.recommended).tolist() == base.tolist()
    assert used.error_ra == used.used[0].relative_error()[0] == made[0].relative_error()[7]
    assert used.error_ra_validation == made[1].relative_error()[7]
    tied = replace(small.submodel, M=np.array([[1.0], [1.0], [0.0], [0.0]]))
    for apart in (
        replace(used, submodel=tied),
        replace(used, physical=replace(real, as_good=False)),
    ):
        assert not apart.physical_used
        assert apart.recommended == [own]


def test_signs_that_physics_forbids_are_named_and_make_a_model_impossible(ladder):
    results = ladder[-1]
    assert results[0].estimate.value[2] < -0.25  # of c and d together: neither's sign is known
    assert results[0].infeasible == ("b",)
    assert not results[0].feasible
    assert results[1].infeasible == ()
    assert not results[1].feasible  # the certificate says so


PART = submodel("full", [0], "a", [0])


def judge_beside(ladder, *shares, named=0):
    model = fitted_model(PART, ladder[2], np.ones(4))
    return decide_model(model, 1.0, default_rng(0), 0, None, lacking(*shares, named=named))


def test_a_value_that_missing_effects_move_to_a_forbidden_sign_is_in_doubt(ladder):
    _, (found,), infeasible = judge_beside(ladder, (1.0, 3.0), named=1)
    assert (found.word, infeasible) == ("not identifiable, model in doubt", ())


def lacking(*shares, rows=1.0, named=0):
    at, one = np.arange(1), np.ones((1, 1))
    term = SimpleNamespace(group=SimpleNamespace(family="stribeck_friction", place="j"))
    own = tuple(Share(term, p, p, at, value * one[0], 0 * one) for p, value in shares)
    return MissingEffects((term,) * named, own, (JointRows(at, rows * one, at, one),) * 2)


def test_a_prior_holds_a_value_that_rows_hardly_determine_against_missing_effects():
    told = lacking((1.0, 1.0), rows=1e-6, named=1).of_labels
    estimate = SimpleNamespace(kept=(0,), weights=np.full(2, 0.5))
    shifts = [told(PART, estimate, known).shift for known in (None, np.eye(1, 2))]
    assert_allclose(np.ravel(shifts), [1e6, 1e-6])


def test_a_doubt_by_a_rare_effect_states_its_probability_and_the_other_value(ladder):
    rare, frequent = (0.004, -20.0), (0.1, -30.0)
    for shares, says, doubted in (
        ([rare], "friction in j (probability below 1 %), this would be 21", []),
        ([rare, frequent], "may lack", [0]),
    ):
        fit, verdicts, _ = judge_beside(ladder, *shares)
        assert says in verdicts[0].reason
        assert list_doubted(SimpleNamespace(fit=fit, verdicts=verdicts)) == doubted


def test_verdicts_say_what_a_column_cannot_be_told_from(ladder):
    found = {v.name: v for v in ladder[-1][0].verdicts}
    assert found["a"].verdict == "identifiable"
    assert found["b"].flags == ("model in doubt",)  # physics forbids its sign
    assert found["c"].verdict == found["d"].verdict == "not identifiable"
    assert "determines only its combination with d" in found["c"].reason
    assert "determines only its combination with c" in found["d"].reason
    assert [found[n].nominal for n in "abcd"] == pytest.approx([1.0, 2.0, 3.0, 4.0])


def test_a_columns_size_is_its_root_mean_square_over_all_rows(ladder):
    W, _, every, *_ = ladder
    expected = np.sqrt((W**2).mean((0, 1)))
    assert_allclose(column_rms(every), expected, rtol=1e-5)
    assert_allclose(column_rms(merge_blocks(every, 1e9)), expected, rtol=1e-5)


def test_a_columns_effect_is_told_at_the_joint_that_feels_it_most(ladder):
    W, tau, every, fits, *_ = ladder
    residual = tau - W @ fits[0].value
    each = np.sqrt((W**2).sum(0) / (residual**2).sum(0)[:, None])
    found = column_noise(every, fits[0])
    assert_allclose(found, each.max(0), rtol=1e-5)
    assert (found > 1.5 * each.min(0)).all()
