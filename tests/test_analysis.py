"""The main job from logs to the answer."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Analysis, Noise, Preparation, Robot, analyze, diagnose, prune
from identifiability.estimation.verdict import Class
from identifiability.foundation.findings import Finding
from identifiability.regression.reduction import USUAL_EFFECTS, LadderEntry, ModelEntry
from identifiability.report.answers.commands import export_line
from identifiability.workflows.export.workflow import save_robot

from .marks import everything


@pytest.fixture(scope="module")
def result(simulated_session):
    logs = (simulated_session("3-rps", name, seed) for name, seed in (("601", 0), ("595", 1)))
    return analyze("3-rps", *logs)


def test_models_1_to_4_are_fitted_validated_and_counted(result):
    frame = result.ladder_frame()
    assert frame["parameters"].tolist() == [37, 24, 18, 12]
    assert frame["paper_identified"].tolist()[1:] == [12, 12, 12]
    assert 3 <= frame["paper_identified"].iloc[0] <= 6
    assert frame["error_ra"].between(0.040, 0.048).all()
    # Fewer parameters fit no better, but for what weights and instruments leave to other sums.
    assert (np.diff(frame["error_ra"]) > -1e-3 * frame["error_ra"][1:]).all()
    assert frame["error_ra_validation"].between(0.040, 0.055).all()


def test_model_1_is_physically_infeasible_and_the_selected_model_is_not(result):
    assert not result.full.feasible
    assert result.full.infeasible
    assert result.chosen.feasible
    assert result.chosen.name in ("Model 3", "Model 4")


def test_every_verdict_has_a_reason_and_says_why_the_10x_rule_differs(result):
    for model in result.models:
        for v in model.verdicts:
            assert v.reason.endswith(".")
            differs = v.paper_rule != (v.verdict is Class.IDENTIFIABLE)
            assert ("10× rule" in v.reason) == differs


def test_where_nothing_is_held_out_the_error_is_cross_validated(noisy_log):
    out = analyze("3-rps", noisy_log, "none", replicates=50)
    assert "cross-validation" in out.validation_kind
    full = out.models[0]
    small = out.models[3]
    assert full.error_ra_validation > full.error_ra
    assert small.error_ra_validation < 0.055


def test_the_same_inputs_give_the_same_result_and_a_data_frame_is_a_log(arm_log):
    given = arm_log, arm_log, arm_log.to_frame()
    a, b, c = (analyze("two-link", x, "none", replicates=50) for x in given)
    assert a.to_dict() == b.to_dict()
    assert a.to_dict()["models"] == c.to_dict()["models"]


@pytest.mark.parametrize(
    "robot",
    [
        *("five-bar", "six-dof-arm"),
        # The first two are analysed by many other tests.
        *(
            everything(name)
            for name in (
                "3-rps",
                "six-ups",
                "two-link",
                "delta",
                "3-rrr",
                "palletizer",
                "six-actuators",
            )
        ),
    ],
    indirect=True,
)
def test_other_robots_are_analysed_without_special_cases(simulated, robot):
    noise = Noise(torque=0.02)
    name = "601" if robot.name == "3-rps" else "a"
    out = analyze(robot, simulated(robot.name, name, 0, noise, 400), replicates=20)
    assert np.isfinite(out.full.error_ra)
    assert out.full.error_ra < 0.05
    assert out.chosen.count(Class.IDENTIFIABLE) > 0


def test_computed_derivatives_give_the_same_parameters_as_true_ones(simulated):
    """Two-link arm, no noise: filtering torque and columns alike leaves the parameters alone."""
    log = simulated("two-link", "a", 0, Noise(), 3000)
    exact = analyze("two-link", log, replicates=0)
    computed = analyze(
        "two-link", log, replicates=0, preparation=Preparation(derivatives="butterworth")
    )
    a, b = (x.to_frame("full model", details=True) for x in (exact, computed))
    assert any("low-pass" in note for note in computed.samples[0].notes)
    big = a["torque_share"] > 0.02
    assert_allclose(b["value"][big], a["value"][big], rtol=0.02)


def test_a_log_given_twice_is_refused(simulated, rejected):
    """Its repetition would pass for new evidence, whether fitted or held out."""
    log = simulated("two-link", "a", 0)
    for run in (analyze, prune, diagnose):
        with rejected("is the log a that is fitted"):
            run("two-link", log, validate=log)
        with rejected("given twice"):
            run("two-link", [log, log])


def test_numbers_of_a_file_are_believed_contradicted_or_left_open(
    simulated_session, tmp_path, two_link
):
    log = simulated_session("two-link", "a", samples=400)
    true = analyze("two-link", log, replicates=0)
    assert {*true.file_frame()["logs"]} == {"agrees", "not determined"}
    odd = analyze("two-link", replace(log, tau=0.01 * log.tau), replicates=0)
    assert odd.answers()[2].tone == "amber"
    assert 'side = "motor"' in " ".join(odd.warnings)
    wrong = {"link2.mx": 1.06, "elbow.Fv": 2.0, "link2.mz": 0.01, "shoulder.Fc": 0.0}
    values = {n: x * two_link.nominal[n] or x for n, x in wrong.items()}
    vendor = save_robot(two_link, values, tmp_path / "fitted.xml")
    found = analyze(vendor, log, "none", replicates=0)
    assert "robot file: link2.mx" in found.warnings[0]
    small = {n: 0.05 * x for n, x in two_link.nominal.items() if "link2." in n}
    file = save_robot(two_link, small, tmp_path / "light.xml")
    sprung = replace(log, tau=log.tau + np.array([0.0, 0.3]) * log.q**3)
    light, lacks = (analyze(file, x, "none", replicates=0) for x in (log, sprung))
    assert "Does link2 carry a tool or load that the file lacks?" in light.warnings[-1]
    assert "The model may lack torque that depends on position in elbow" in lacks.warnings[-1]
    play = Finding("odd_joint", what="", share=90, then="", play=["elbow"])
    assert "Play in the gear of elbow may" in replace(lacks, hints=[play]).warnings[-1]
    arm = Robot.load("palletizer")
    file = save_robot(arm, {n: 0.05 * x for n, x in arm.nominal.items()}, tmp_path / "small.xml")
    small = analyze(file, simulated_session(arm.name, "a", samples=400), "none", replicates=0)
    assert "Bodies of the stated size have no such values" in small.warnings[-1]
    frame = found.file_frame().set_index("name")
    assert set(frame.index[:2]) == {"elbow.Fv", "link2.mx"}
    assert "shoulder.Fc" not in frame.index  # zero states nothing
    assert export_line(Robot.load(vendor), "x.json").endswith("--out refitted.xml")
    assert set(frame.query("logs == 'contradicted'").index) <= set(wrong)
    assert set(frame["logs"]) == {"contradicted", "agrees", "not determined"}
    assert abs(frame["value"]["elbow.Fv"] / two_link.nominal["elbow.Fv"] - 1) < 0.1
    table = found.tables()[-1]
    assert table.caption.startswith("Which numbers of the robot file may I believe? ")


@pytest.mark.parametrize("joint, size", [("shoulder", 0.08), ("elbow", 0.08), ("elbow", 0.5)])
def test_a_torque_scale_is_of_the_fitted_robot_not_of_a_file(
    simulated, tmp_path, joint, size, two_link
):
    robot, share = two_link, {"link1": 0.75, "link2": 1.25}  # no friction, no rotors
    values = {n: share.get(n.partition(".")[0], 0.0) * x for n, x in robot.nominal.items()}
    file = Robot.load(save_robot(robot, values, tmp_path / "vendor.xml"))
    log = simulated("two-link", "a", noise=Noise(additive=0.02), samples=500)
    log = replace(log, tau=log.tau * np.where(np.array(robot.joints) == joint, 1 + size, 1.0))
    model = ModelEntry(name="scaled", effects=[*USUAL_EFFECTS, f"torque_scale@{joint}"])
    found = analyze(file, log, ladder=LadderEntry(models=[model]), replicates=0)
    true = {**robot.nominal, f"{joint}.scale": size}
    truth = found.structure.G @ [true[n] for n in found.structure.columns]
    pairs = zip(found.chosen.verdicts, truth, strict=True)
    off = [(v.value - x) / v.sigma_robust for v, x in pairs if v.sure]
    assert len(off) == 10
    assert np.abs(off).max() < 3
    back = Analysis.from_json(found.to_json(tmp_path / "result.json"), file)
    assert back.robot.reference == pytest.approx(found.robot.reference)
    bare = replace(log, dq=None, ddq=None)  # all rows of positions alone are searched
    ((p,),) = [e.placements for e in diagnose(file, bare, effects=["torque_scale"]).effects]
    assert {p.place, *(r.place for r in p.rivals)} == {*robot.joints}  # all masses would be as well
