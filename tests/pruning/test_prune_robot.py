"""From robot and log to the model worth using, no truth, no simulation."""

from itertools import pairwise

import pytest
from numpy.testing import assert_allclose

from identifiability import Noise, Robot, analyze, prune
from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.verdict import Class
from identifiability.regression.reduction import ladder_path

from ..marks import everything

SLIDERS = {f"slider{k}.{kind}" for k in (1, 2, 3) for kind in ("Fv", "Fc", "Jr")}
MODEL_4 = SLIDERS | {"platform.mx", "leg2_upper.m", "leg3_upper.m"}


def test_the_3rps_ends_at_the_papers_smallest_model_without_knowing_it(pruned):
    assert set(pruned.chosen.columns) == MODEL_4
    assert pruned.chosen.feasible
    sure = [v.verdict is Class.IDENTIFIABLE for v in pruned.chosen.verdicts]
    # What may be missing may put a third in doubt, by chance.
    assert sum(sure) >= 2 * len(sure) // 3


@pytest.mark.parametrize("trajectory, seed", [("601", 100), ("601", 103), ("571", 110)])
def test_slow_torque_noise_hides_no_parameter_and_adds_none(simulated, trajectory, seed):
    log = simulated("3-rps", trajectory, seed, Noise(additive=0.05, correlation=0.9))
    out = prune("3-rps", log, "none", ladder_path(Robot.load("3-rps")), replicates=0)
    assert set(out.chosen.columns) == MODEL_4


def test_a_model_that_no_real_robot_can_have_gives_way_where_real_robots_predict_alike(simulated):
    """Its inertia of the platform is worth eight nats, and real bodies have as much without it."""
    out = prune("3-rps", simulated("3-rps", "601", 1), replicates=0)
    assert out.chosen.feasible
    assert set(out.chosen.columns) == MODEL_4
    at = out.selected
    assert out.models[at].density < out.models[at - 1].density - LEVELS.nats


@pytest.mark.parametrize(
    "trajectory, seed",
    [
        ("571", 3),
        *(everything(*x) for x in (("595", 4), ("601", 5))),
    ],
)
def test_other_logs_give_nine_friction_and_actuator_parameters_and_few_others(
    simulated, trajectory, seed
):
    out = prune("3-rps", simulated("3-rps", trajectory, seed), replicates=0)
    chosen = set(out.chosen.columns)
    assert chosen >= SLIDERS
    assert 2 <= len(chosen - SLIDERS) <= 6
    assert out.chosen.feasible


def test_the_pruned_model_predicts_a_new_trajectory_no_worse_than_the_unpruned(pruned):
    assert pruned.chosen.error_ra_validation <= pruned.full.error_ra_validation
    assert pruned.chosen.error_ra_unseen < pruned.full.error_ra_unseen


def test_every_model_below_the_first_has_a_move_a_reason_and_fewer_parameters(pruned):
    sizes = [len(r) for r in pruned.models]
    assert sizes[0] == 37
    assert all(a > b for a, b in pairwise(sizes))
    for submodel in pruned.models[1:]:
        assert submodel.step.move is not None
        assert submodel.reason.endswith(".")


def test_models_are_compared_by_their_estimates_and_those_as_likely_are_said(pruned):
    assert f"By the same rule, models with {len(pruned.chosen)} to " in pruned.details
    table = pruned.tables()[0]
    at = [column.title for column in table.columns].index("held out")
    held = table.rows[pruned.selected][at]
    assert f"Error on unseen motion: {held.text} of" in pruned.statement
    assert held.key == pruned.chosen.error_ra_validation


def test_the_answer_says_by_which_rule_the_model_was_chosen(pruned):
    best = len(pruned.models[pruned.least])
    assert len(pruned.chosen) < best
    reason = pruned.answers()[0].whole
    assert f"best model ({best} parameters)" in reason
    assert f"surely rises by less than {100 * LEVELS.rise:g} %" in reason.replace("\u00a0", " ")


def test_the_chosen_model_is_a_ladder_that_analyze_reads(pruned, noisy_log, tmp_path):
    path = pruned.write_model(tmp_path / "pruned.toml")
    again = analyze("3-rps", noisy_log, "none", path, replicates=20)
    model = again.models[1]
    assert set(model.submodel.columns) == set(pruned.chosen.columns)
    assert_allclose(
        model.estimate.value, pruned.chosen.estimate.value, rtol=1e-6
    )  # fmt: skip


def test_json_and_report_hold_the_ladder(pruned, tmp_path):
    assert len(pruned.to_dict()["full_parameters"]) == 37
    page = pruned.write_report(tmp_path / "p.html").read_text()
    for words in ("12 of 37 parameters are enough", "What survives", "Values of each joint"):
        assert words in page


def test_the_user_can_keep_and_drop_parameters(simulated, rejected):
    log = simulated("five-bar", "a", 0)
    plain = prune("five-bar", log, replicates=0).chosen.columns
    assert "left_proximal.mz" not in plain
    assert "right_shoulder.Fv" in plain
    kept = {"forbid": ["left_proximal.mz"]}
    gone = {"force": ["right_shoulder.Fv"]}
    out = prune("five-bar", log, **kept, **gone, replicates=0)
    assert "left_proximal.mz" in out.chosen.columns
    assert "right_shoulder.Fv" not in out.chosen.columns
    with rejected(r"did you mean 'left_proximal\.mz'"):
        prune("five-bar", log, forbid=["left_proximal.mzz"])
    with rejected("to be kept and to be dropped"):
        prune("five-bar", log, **kept, force=kept["forbid"])


def test_pruning_starts_from_the_users_own_ladder(simulated, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[[models]]\nname = "mine"\neffects = ["rigid_body", "viscous_friction", '
        '"coulomb_friction"]\nzero = ["left_distal.mz"]\n'
    )
    log = simulated("five-bar", "a", 0)
    out = prune("five-bar", log, ladder=path, replicates=0)
    assert "left_distal.mz" not in out.full.columns
    again = analyze("five-bar", log, ladder=out.write_model(tmp_path / "p.toml"), replicates=0)
    assert set(again.models[1].submodel.columns) == set(out.chosen.columns)
