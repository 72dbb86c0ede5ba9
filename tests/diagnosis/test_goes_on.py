"""The diagnosed model goes on: its file is what every other verb takes, and a robot comes out."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identifiability import Case, Robot, analyze, diagnose, excite, export, prune
from identifiability.regression.structure import Structure

from ..roads import waves

MODELS = Path(__file__).parents[2] / "models"
NAMED = ("stribeck_friction@slider1=0.03", "position_ripple@slider2=0.02")
FEW = ("stribeck_friction", "position_ripple")


def test_the_model_file_of_a_diagnosis_is_analysed_and_exported(diagnosis_of, logs_of, tmp_path):
    d = diagnosis_of("3-rps", *NAMED, effects=FEW)
    logs = logs_of("3-rps", *NAMED)
    path = d.write_model(tmp_path / "model.toml")
    assert set(d.problem.plain.model.texts) < set(d.model.texts)
    case = Case("3-rps", logs[:4], logs[4:])
    result = analyze(case, ladder=path, replicates=0)
    assert result.structure.model.texts == d.model.texts
    assert result.shapes == d.completed.shapes  # those of the named effects are in the file
    assert result.chosen.error_ra_validation == pytest.approx(d.held_after, rel=1e-5)
    before = analyze(case, replicates=0)
    assert before.chosen.error_ra_validation == pytest.approx(d.held_before, rel=1e-9)
    assert before.chosen.error_ra == pytest.approx(d.error_before, rel=1e-9)
    result.to_json(tmp_path / "result.json")
    exported = export("3-rps", tmp_path / "result.json", tmp_path / "fit.xml")
    assert exported.beside  # what the file cannot hold
    copy = Robot.load(exported.robot)
    held = Structure.of(copy, d.model)
    told = json.loads((tmp_path / "result.json").read_text())["physical"]["parameters"]
    for name in [n[:-1] for n in told if n.endswith(".Fc+")]:  # one level stands for both ways
        told |= dict.fromkeys((f"{name}+", f"{name}-"), 0.5 * (told[f"{name}+"] + told[f"{name}-"]))
    assert dict(zip(held.columns, held.nominal, strict=True)) == pytest.approx(told, abs=1e-9)
    assert held.robot.shapes == pytest.approx(result.shapes)


@pytest.mark.parametrize(
    "name, of",
    [
        ("3-rps", "Model 3"),
        pytest.param("six-dof-arm", "full model", marks=pytest.mark.everything),
    ],
)
def test_a_diagnosis_ends_with_the_model_that_analyze_selects(name, of, tmp_path):
    case = Case(name, [MODELS / name / "logs" / f"run{k}.csv" for k in (1, 2, 3)])
    d = diagnose(case, quick=True)
    plain = analyze(case, replicates=0)
    assert d.effects
    assert d.used.reduction.name == of
    assert d.held_after < (1 + 1e-4) * plain.chosen.error_ra_validation
    same = analyze(case, ladder=d.write_model(tmp_path / "model.toml"), replicates=0)
    assert sorted(same.chosen.submodel.columns) == sorted(d.fit.names)
    errors = same.chosen.error_ra, same.chosen.error_ra_validation
    assert errors == pytest.approx((d.error_after, d.held_after), rel=1e-4)


def test_the_result_of_a_diagnosis_is_a_model_for_prune_and_excite(diagnosis_of, logs_of):
    d = diagnosis_of("3-rps", *NAMED, effects=FEW)
    logs = logs_of("3-rps", *NAMED)
    assert prune("3-rps", logs[:2], ladder=d, replicates=2).structure.model.texts == d.model.texts
    assert excite("3-rps", model=d, evaluations=20, samples=50).effects == d.model.names


def test_a_spring_in_one_joint_does_not_hide_another_and_stays_where_it_is(logs_of):
    logs = logs_of("two-link", "joint_stiffness@elbow=0.3")
    known = ("rigid_body", "viscous_friction", "coulomb_friction", "joint_stiffness@shoulder")
    few = {"effects": ("joint_stiffness", "free_spring"), "quick": True, "forward": False}
    d = diagnose("two-link", logs[:4], logs[4:], model=known, **few)
    assert [(r.family, r.place) for r in d.refusals] == [("joint_stiffness", "shoulder")]
    assert d.model.texts == (*known, "joint_stiffness@elbow")


def test_a_delay_that_shows_only_beside_missing_friction_is_not_in_the_model(logs_of):
    logs = logs_of("two-link", "stribeck_friction@shoulder=0.1", "time_delay@shoulder=0.02")
    result = analyze("two-link", logs[:4], logs[4:], replicates=0)
    assert "Stribeck" in result.missing.statement
    assert "shoulder.delay" not in result.structure.columns


LIFT = """<mujoco><worldbody><body name="cart"><joint name="X" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="10" diaginertia="1 1 1"/><body name="ram">
<joint name="Z" type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="16" diaginertia="1 1 1"/>
</body></body></worldbody></mujoco>"""


def test_a_mass_that_a_counterweight_carries_is_told_with_it_under_every_model(tmp_path):
    path = tmp_path / "lift.xml"
    t = np.arange(0, 16, 0.008)
    rng = np.random.default_rng(0)
    path.write_text(LIFT)
    w = 2 * np.pi / 8 * np.array([[1, 1], [2, 3], [4, 4]])
    q, v, a = waves(t, w, 0.1, rng.uniform(0, 6, (2, 3)).T)
    tau = np.array([27.5, 39.5]) * a + np.array([20, 60]) * v + np.array([0, 19.5 * 9.81 - 185])
    tau += rng.normal(0, 0.5, tau.shape)
    log = pd.DataFrame(np.column_stack([t, q, tau]), columns=["t", "X.q", "Z.q", "X.tau", "Z.tau"])
    model = diagnose(path, log[:1500], log[1500:]).write_model(tmp_path / "model.toml")
    assert "torque_offset" not in model.read_text()  # none was found
    found = analyze(path, log, ladder=model, replicates=0).to_frame(details=True).loc["ram.m"]
    assert "off(Z)" in found.label
    assert found.lower <= 19.5 - 185 / 9.81 <= found.upper
