"""What is believed agrees with theory, stays possible, and says where it comes from."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze
from identifiability.estimation.verdict import Flag
from identifiability.physical.feasibility import certify
from identifiability.physical.fitted_model import FittedModel, physical_set
from identifiability.robot.locate import locate_robot
from identifiability.workflows.analyze.belief import (
    belief_dict,
    form_belief,
    refine_verdicts,
    state_prior,
)

NOTHING = "The chains are short: 80 draws are 44 autocorrelation times of leg3_upper.mz."


def believe(analysis, result, effort, robot=None):
    return form_belief(fitted(analysis, result, robot), np.random.default_rng(1), effort)


def fitted(analysis, result, robot=None):
    structure = replace(analysis.structure, robot=robot or analysis.robot)
    return FittedModel.of(
        structure, result.submodel, analysis.information, result.estimate.estimator
    )


@pytest.fixture(scope="module")
def analysis(simulated_session):
    logs = [simulated_session("3-rps", t, seed) for t, seed in (("601", 0), ("595", 1))]
    return analyze("3-rps", *logs, replicates=100, posterior=True)


@pytest.fixture(scope="module")
def unpruned(analysis):
    """The posterior of Model 1, with enough draws to converge."""
    return believe(analysis, analysis.full, {"walkers": 8, "draws": 120, "warmup": 20})


def test_all_draws_belong_to_a_real_robot(analysis):
    chosen = analysis.chosen
    structure = analysis.structure
    to_x = np.linalg.pinv(chosen.submodel.M) @ structure.G
    for x in analysis.belief.physical.chains[0, 0, :5]:
        assert certify(to_x, x, physical_set(structure)).feasible


def sidecar(folder, prior):
    """The shipped sidecar of the two-link arm with a prior."""
    path = folder / "two-link.toml"
    shipped = locate_robot("two-link").with_suffix(".toml").read_text()
    path.write_text(f"{shipped}\n[prior]\n{prior}\n")
    return path


@pytest.fixture(scope="module")
def arm(arm_log):
    return analyze("two-link", arm_log, replicates=0)


def test_a_prior_that_the_user_states_moves_the_posterior(arm, tmp_path):
    robot = Robot.load("two-link", sidecar(tmp_path, '"link2.m" = {mean = 3.0, sd = 0.02}'))
    few = {"walkers": 4, "draws": 10, "warmup": 5}
    before, after = (believe(arm, arm.full, few, r).standard for r in (None, robot))
    assert before["link2.m"].std() > 0.2
    assert abs(after["link2.m"].mean() - 3.0) < 0.03
    assert after["link2.m"].std() < 0.03


def test_a_prior_that_cannot_be_is_refused_with_a_sentence(arm, tmp_path, rejected):
    sentence = "-3 ± 0.1 for 'elbow.Fv', which cannot be neg"
    robot = Robot.load("two-link", sidecar(tmp_path, '"elbow.Fv" = {mean = -3.0, sd = 0.1}'))
    full = arm.full
    model = fitted(arm, full, robot)
    with rejected(sentence):
        state_prior(model.structure, model.data)
    belief = believe(arm, full, {"walkers": 2, "draws": 4, "warmup": 1}, robot)
    assert belief.physical is None
    assert not belief.standard
    assert refine_verdicts(full.verdicts, belief) == full.verdicts
    assert sentence in belief.note


def test_a_chain_that_has_not_converged_is_withheld_in_json(analysis, unpruned):
    physical = unpruned.physical
    convergence = replace(physical.convergence, reasons=(NOTHING,))
    belief = replace(unpruned, physical=replace(physical, convergence=convergence))
    shown, withheld = (belief_dict(analysis.full.submodel.columns, b) for b in (unpruned, belief))
    assert len(shown["physical"]["parameters"]) == 37
    assert withheld["physical"]["reasons"] == [NOTHING]
    assert "parameters" not in withheld["physical"]
    ends = [row["interval95"] for row in shown["physical"]["parameters"]]
    assert [pair is not None for pair in ends] == physical.stated.tolist()
    assert 20 < physical.stated.sum() < 37
    json.dumps(withheld, allow_nan=False, default=float)


def test_what_the_data_leave_open_is_determined_by_bodies_or_is_the_prior(analysis, unpruned):
    full = analysis.full
    assert unpruned.physical.convergence.trustworthy, unpruned.physical.convergence.reasons
    refined = refine_verdicts(full.verdicts, unpruned)
    kinds = {v.name: v.look for v in refined}
    # The platform is flat. In its plane data and prior leave much that no body can have; out of
    # it, and across the thin legs, the prior has ruled that out already. Of the first moment the
    # data say more than bodies do.
    assert kinds["platform.Izz"] == Flag.BY_CONE
    for name in ("platform.Ixz", "platform.Iyz", "leg1_upper.mx", "platform.mx"):
        assert kinds[name] == Flag.BY_PRIOR
    for k, (before, after) in enumerate(zip(full.verdicts, refined, strict=True)):
        assert after.verdict is before.verdict
        if not before.open:
            assert after == before
        if after.look in (Flag.BY_CONE, Flag.BY_PRIOR):
            assert after.reason.startswith(before.reason)
            assert "prior around the robot file" in after.reason
            row = after.to_row()
            assert (after.believed is not None) == unpruned.physical.stated[k]
            if after.believed is None:
                assert after.look == Flag.BY_PRIOR
                continue
            assert row["interval95"] == unpruned.physical.interval[k].tolist()
            assert row["data_interval95"] == list(before.data_interval95)
            assert f"{row['interval95'][0]:.3g} … {row['interval95'][1]:.3g}" in after.reason
        if after.look == Flag.BY_CONE:  # like with like: data and prior without bodies
            assert unpruned.physical.sd[k] ** 2 < 0.5 * unpruned.data_sd[k] ** 2
            assert unpruned.physical.sd[k] ** 2 < 0.5 * after.sigma_robust**2
