"""An effect of the user's own, in one file: every command, ladder, export and page knows it."""

import json

import pytest
from typer.testing import CliRunner

from identifiability import Robot
from identifiability.cli import app
from identifiability.effects import forget

PLUGIN = '''
"""Cogging of known pitch."""

import numpy as np

from identifiability.effects import AlongAxes, Family, register

PITCH = 0.35  # rad


class Cogging(AlongAxes):
    name = "cogging"
    equation = "τ = Cg cos(2π q/0.35)"
    source = "data sheet of the motor"
    units = (("Cg", "N·m", "N"),)

    def curves(self, at):
        return [np.cos(2 * np.pi * at.travel / PITCH)]


register(Family(
    Cogging(), "cogging", against="position",
    law=lambda speed, position, load: np.cos(2 * np.pi * position / PITCH),
))
'''  # fmt: skip

LADDER = """
[[models]]
name = "with cogging"
effects = ["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia",
           "cogging@elbow"]
"""


def run(*words):
    result = CliRunner().invoke(app, [str(w) for w in words])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plugin")
    (folder / "cogging.py").write_text(PLUGIN)
    (folder / "ladder.toml").write_text(LADDER)
    for name in "abcd":
        run("simulate", "two-link", name if name in "ab" else "random", "--seed", ord(name),
            "--hide", "cogging@elbow=0.1", "--noise", "torque=0.01", "--samples", 400,
            "--plugin", folder / "cogging.py", "--out", folder / f"{name}.csv")  # fmt: skip
        forget("cogging")
    return folder


@pytest.fixture
def plugin(folder):
    yield folder / "cogging.py"
    forget("cogging")


def logs(folder):
    return [folder / f"{name}.csv" for name in "abc"], folder / "d.csv"


@pytest.mark.pictures
def test_a_diagnosis_names_it_and_its_page_draws_it_over_position(folder, plugin):
    train, held = logs(folder)
    page, found = folder / "gap.html", folder / "gap.json"
    few = "cogging,position_ripple,gear_ripple,stribeck_friction"
    run("diagnose", "two-link", *train, "--validate", held, "--quick", "--plugin", plugin,
        "--effects", few, "--report", page, "--json", found)  # fmt: skip
    effects = json.loads(found.read_text())["effects"]
    assert [(e["effect"], e["joints"]) for e in effects] == [("cogging", ["elbow"])]
    text = page.read_text()
    assert "position [rad]" in text


def test_a_ladder_has_it_and_an_export_is_read_back(folder, plugin):
    train, held = logs(folder)
    result, out = folder / "result.json", folder / "fitted.xml"
    run("analyze", "two-link", *train, "--validate", held, "--ladder", folder / "ladder.toml",
        "--quick", "--json", result, "--plugin", plugin)  # fmt: skip
    content = json.loads(result.read_text())
    fitted = content["physical"]["parameters"]["elbow.Cg"]
    shown = {p["name"]: p["value"] for p in content["full_parameters"]}
    assert shown["elbow.Cg"] == pytest.approx(fitted, rel=0.05)
    forget("cogging")
    said = run("export", "two-link", result, "--out", out, "--plugin", plugin)
    assert "cannot hold cogging (elbow.Cg)" in " ".join(said.split())
    assert Robot.load(out).nominal["elbow.Cg"] == fitted


def test_pruning_keeps_it_and_its_model_file_is_read_again(folder, plugin):
    train, held = logs(folder)
    model = folder / "pruned.toml"
    run("prune", "two-link", *train, "--validate", held, "--quick", "--plugin", plugin,
        "--ladder", folder / "ladder.toml", "--out", model,
        "--json", folder / "pruned.json")  # fmt: skip
    assert "cogging@elbow" in model.read_text()
    kept = json.loads((folder / "pruned.json").read_text())
    assert "elbow.Cg" in {p["name"] for p in kept["parameters"]}


def test_a_motion_separates_it_from_another(folder, plugin):
    run("excite", "two-link", "--separate", "cogging@elbow", "--separate", "joint_stiffness@elbow",
        "--set", "evaluations=50", "--out", folder / "motion.json", "--plugin", plugin)  # fmt: skip
    assert (folder / "motion.json").exists()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x = 1\n", "registers no effect"),
        ("a = 1\nb = a / 0\n", "fails in line 2 (ZeroDivisionError"),
    ],
)
def test_a_plugin_that_is_none_is_refused_in_a_sentence(tmp_path, text, sentence):
    path = tmp_path / "own.py"
    if text is not None:
        path.write_text(text)
    out = tmp_path / "out.csv"
    result = CliRunner().invoke(
        app, ["simulate", "two-link", "a", "--out", str(out), "--plugin", str(path)]
    )
    assert result.exit_code == 2
    assert sentence in " ".join(result.output.split())
    assert not out.exists()
