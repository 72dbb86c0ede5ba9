"""A label says what it stands for: on the shipped closed chain no number bears a wrong name."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from identifiability import Robot, analyze, new_study
from identifiability.foundation.findings import of_key
from identifiability.foundation.rounding import format_measured
from identifiability.regression.reduction import USUAL_EFFECTS, LadderEntry, ModelEntry
from identifiability.report.answers.values_table import joint_values, offset_table
from identifiability.workflows import case
from identifiability.workflows.analyze import judge
from identifiability.workflows.analyze.workflow import say_unequal

#: Whose friction the file states as it was planted.
SLIDERS = [f"slider{k}.Fv" for k in (1, 2, 3)]


@pytest.fixture(scope="module", params=[case.COMPLETED, ()])
def found(request, tmp_path_factory):
    """The shipped 3-RPS with friction in passive joints, which is named, or of no model."""
    made = new_study(tmp_path_factory.mktemp("3-rps") / "study", "3-rps")
    logs = [made.folder / f"run{k}.csv" for k in (1, 2)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(case, "COMPLETED", request.param)
        return analyze(made.folder / "robot.xml", logs, made.folder / "run3.csv", replicates=20)


def test_an_interval_holds_what_was_planted_wherever_a_sign_is_certain(found):
    planted = Robot.load("3-rps").nominal
    sliders = [
        v
        for v in found.chosen.verdicts
        if v.name in SLIDERS and v.verdict.value != "not identifiable"
    ]
    assert sliders
    assert all(v.interval95[0] <= planted[v.name] <= v.interval95[1] for v in sliders)


def test_a_mass_that_an_offset_of_its_slider_could_be_is_identifiable_without_it(found):
    reasons = {v.name: v.reason for v in found.chosen.verdicts}
    assert "if slider3 has no torque offset" in reasons["leg3_upper.m"]
    said = "an offset of slider3 from the combination with leg3_upper.m"
    assert said in of_key(found.hints, "excluded_offsets")[0]
    assert "torque_offset" in found.next()[0][1] or found.missing.functions
    assert "combination with leg3_upper.m" in [row[0].text for row in offset_table(found).rows]
    places = [row[0].text for row in joint_values(found, "").rows]
    assert ("hinge2" in places) == ("hinge2.Fv" in found.chosen.submodel.columns)


def test_a_value_many_times_that_of_equal_joints_is_questioned(found):
    verdicts = {v.name: v for v in found.chosen.verdicts}
    verdicts["slider2.Fv"] = replace(verdicts["slider2.Fv"], value=1e5)
    (said,) = say_unequal(found.robot, Mock(verdicts=verdicts.values()))
    assert said.startswith("slider2.Fv is ")


def test_an_offset_of_the_model_needs_no_second_one(monkeypatch):
    monkeypatch.setattr(judge, "allow_offsets", lambda *_: np.ones((1, 2)))
    model = Mock()
    model.structure.robot.joints = "ab"
    model.submodel.columns = ["a.off"]
    fit = Mock(sigma=np.zeros(1), value=np.ones(1))
    assert judge._exclude_offsets(model, fit) == (("b",),)


def test_one_value_has_one_error_and_a_reason_where_exports_get_another(found, tmp_path):
    report = found.write_report(tmp_path / "report.html").read_text()
    assert report.count("an offset of slider3 from") == 1
    rows = found.to_dict()["parameters"]
    (page,) = (t for t in found.tables() if t.long)
    pairs = list(zip(found.chosen.verdicts, rows, strict=True))
    far = [abs(row["used"] - v.value) > v.sigma_label for v, row in pairs]
    assert [bool(row[1].more) for row in page.rows] == far
    for (v, _), shown in zip(pairs, page.rows, strict=True):
        value, error = format_measured(v.value, v.sigma_label)
        assert (shown[1].text, shown[2].text) == (value, f"± {error}")
        if v.name in SLIDERS:
            assert f"{value}\xa0{v.unit} ±\xa0{error}" in report


def test_a_value_that_is_known_in_a_sum_alone_is_no_value_of_one_parameter(simulated):
    effects = [*USUAL_EFFECTS, "coulomb_asymmetry@elbow+lift", "torque_offset@lift"]
    ladder = LadderEntry(models=[ModelEntry(name="M", effects=effects)])
    log = simulated("scara", "a", samples=1000)
    found = analyze("scara", log, "none", ladder, quick=True, profile=["flange.m"])
    _, moved, *_, rotor = joint_values(found, "").rows[2]
    assert (rotor.text, rotor.note) == ("–", "only in combination with lift.off")
    # Spindle, flange, and the rotor of the nut behind the screw.
    assert moved.note == "identifiable; file 2.537 kg"
    assert abs(moved.key - 2.537) < 0.5
    assert "combination with m(spindle)" in found["flange.m"].reason
    low, high = found.profiles[0].region
    assert low < found.robot.nominal["flange.m"] < high
    levels = [name for name in found.base.names if ".Fc" in name]
    assert levels[1:] == ["lift.Fc", "spin.Fc", "nut.Fc", "elbow.Fc+", "elbow.Fc-"]
