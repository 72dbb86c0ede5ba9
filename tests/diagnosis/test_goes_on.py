"""The diagnosed model goes on: its file is what every other verb takes, and a robot comes out."""

import json

import pytest

from identifiability import Robot, analyze, excite, prune
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.export import export

NAMED = ("stribeck_friction@slider1=0.03", "position_ripple@slider2=0.02")
FEW = ("stribeck_friction", "position_ripple")


def test_the_model_file_of_a_diagnosis_is_analysed_and_exported(diagnosis_of, logs_of, tmp_path):
    d, logs = diagnosis_of("3-rps", *NAMED, effects=FEW), logs_of("3-rps", *NAMED)
    path = d.write_model(tmp_path / "model.toml")
    assert set(d.plain.model.texts) < set(d.model.texts)
    result = analyze("3-rps", logs[:4], logs[4:], path, replicates=0)
    assert result.structure.model.texts == d.model.texts
    assert result.shapes == d.completed.shapes  # those of the named effects are in the file
    assert result.models[0].error_ra_validation == pytest.approx(d.held_after, rel=1e-6)
    before = analyze("3-rps", logs[:4], logs[4:], replicates=0)
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


def test_the_result_of_a_diagnosis_is_a_model_for_prune_and_excite(diagnosis_of, logs_of):
    d, logs = diagnosis_of("3-rps", *NAMED, effects=FEW), logs_of("3-rps", *NAMED)
    pruned = prune("3-rps", logs[:2], ladder=d, replicates=2)
    assert pruned.structure.model.texts == d.model.texts
    planned = excite("3-rps", model=d, evaluations=20, samples=50, seed=0)
    assert planned.effects == d.model.names


def test_a_spring_in_one_joint_does_not_hide_another_and_stays_where_it_is(logs_of, tmp_path):
    logs = logs_of("two-link", "joint_stiffness@elbow=0.3")
    known = ("rigid_body", "viscous_friction", "coulomb_friction", "joint_stiffness@shoulder")
    few = {"effects": ("joint_stiffness", "free_spring"), "quick": True, "forward": False}
    d = diagnose("two-link", logs[:4], logs[4:], model=known, **few)
    assert [(e.name, e.joints) for e in d.effects] == [("joint_stiffness", ("elbow",))]
    assert [(r.family, r.place) for r in d.refusals] == [("joint_stiffness", "shoulder")]
    assert d.model.texts == (*known, "joint_stiffness@elbow")
