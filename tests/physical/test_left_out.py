"""What a model leaves out, holds or ties is so in the nearest real robot, and never free."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import analyze
from identifiability.physical.fitted_model import FittedModel, find_fixed
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.workflows.analyze.belief import form_belief

EFFECTS = ["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia"]


def fit(arm_log, cad_weight=0.0, **submodel):
    entry = LadderEntry(models=[ModelEntry(name="reduced", effects=EFFECTS, **submodel)])
    return analyze("two-link", arm_log, ladder=entry, replicates=0, cad_prior=cad_weight)


def base_values(result):
    phi = np.array(
        [result.models[-1].physical.parameters()[p.name] for p in result.base.parameters]
    )
    return dict(zip(result.base.names, result.base.G @ phi, strict=True))


def test_what_a_model_leaves_out_is_zero_in_the_nearest_real_robot(arm_log):
    result = fit(arm_log, zero=["elbow.Ia", "elbow.Fv", "elbow.Fc", "link1.mz"])
    found = result.models[-1].physical.parameters()
    assert [found[f"elbow.{kind}"] for kind in ("Ia", "Fv", "Fc")] == [0.0, 0.0, 0.0]
    assert abs(base_values(result)["link1.mz"]) < 1e-6  # of 0.1 kg·m that noise would fit to it


@pytest.mark.parametrize("cad_weight, near", [(0.0, 2e-6), (None, 3e-3)])
def test_a_prior_hardly_moves_what_a_model_holds(arm_log, cad_weight, near):
    result = fit(arm_log, cad_weight, hold={"elbow.Ia": 0.05, "link1.mx": 2.0})
    chosen = result.models[-1].physical
    assert (chosen.cad_weight > 0) == (cad_weight is None)
    assert chosen.parameters()["elbow.Ia"] == 0.05
    assert base_values(result)["link1.mx"] == pytest.approx(2.0, abs=near)


def test_what_a_model_ties_is_equal_in_the_nearest_real_robot(arm_log):
    tie = {"Fv": ["shoulder.Fv", "elbow.Fv"], "mz": ["link1.mz", "link2.mz"]}
    result = fit(arm_log, tie=tie)
    found = base_values(result)
    assert found["shoulder.Fv"] == pytest.approx(found["elbow.Fv"], rel=1e-12)
    assert found["link1.mz"] == pytest.approx(found["link2.mz"], abs=1e-6)


def test_the_stated_error_of_the_nearest_real_robot_is_that_of_all_its_parameters(arm_log):
    result = fit(arm_log, zero=["elbow.Ia", "link2.mx"])  # the bodies need some of the latter
    physical = result.models[-1].physical
    phi = np.array([physical.parameters()[p.name] for p in result.base.parameters])
    assert_allclose(physical.base, result.base.G @ phi)
    assert physical.base[list(result.base.names).index("link2.mx")] == pytest.approx(0.0, abs=0.02)


def test_bodies_keep_what_they_need_although_it_is_left_out(arm_log):
    for gone, needed in (("elbow.Ia", False), ("link2.Iyy", True)):  # none turns without inertia
        model = fit(arm_log, zero=[gone]).models[-1]
        left_out = ~model.submodel.M.any(axis=1)
        assert (np.abs(model.physical.base[left_out]).max() > 1e-3) == needed


def test_a_sum_of_what_cannot_be_negative_is_zero_part_by_part(robot):
    outside = np.setdiff1d(np.arange(robot.region.size), robot.region.bodies)
    G = np.zeros((1, robot.region.size))
    G[0, outside[:2]] = 1.0, 2.0
    region = replace(robot.region, nonnegative=np.isin(np.arange(G.size), outside))
    fixed = find_fixed(region, G, np.zeros((1, 0)), np.zeros(1))
    assert fixed.parameters.nonzero()[0].tolist() == outside[:2].tolist()


def test_what_a_model_leaves_out_holds_or_ties_is_so_in_every_draw_of_the_posterior(arm_log):
    submodel = ModelEntry(
        name="reduced", effects=EFFECTS, zero=["elbow.Fc", "link1.mz"], hold={"elbow.Ia": 0.05},
        tie={"Fv": ["shoulder.Fv", "elbow.Fv"]},
    )  # fmt: skip
    found = analyze("two-link", arm_log, ladder=LadderEntry(models=[submodel]), replicates=0)
    reduced = found.models[-1]
    model = FittedModel.of(
        found.structure, reduced.submodel, found.information, reduced.estimate.estimator
    )
    few = {"walkers": 4, "draws": 20, "warmup": 10}
    belief = form_belief(model, np.random.default_rng(0), few)
    draws = {name: x.ravel() for name, x in belief.standard.items()}
    assert (draws["elbow.Fc"] == 0.0).all()
    assert (draws["elbow.Ia"] == 0.05).all()
    assert_allclose(draws["shoulder.Fv"], draws["elbow.Fv"], rtol=1e-9)
    base = np.column_stack(list(draws.values())) @ found.base.G.T
    mz = base[:, list(found.base.names).index("link1.mz")]
    full = found.models[0].estimate
    sigma = full.sigma[list(full.columns).index("link1.mz")]  # of what noise would fit to it
    assert np.abs(mz.mean()) < sigma
    assert mz.std() < 1.2 * sigma
    assert np.isfinite(belief.physical.convergence.rhat).all()
