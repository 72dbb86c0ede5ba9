"""An effect of the user's own, in one file: every command, ladder, export and page knows it."""

import json

import pytest

from identifiability import Robot
from identifiability.effects import forget

PLUGIN = '''
"""Cogging of known pitch."""

import numpy as np

from identifiability.effects import Shaped, declare

PITCH = 0.35  # rad


@declare(
    "cogging", against="position",
    law=lambda speed, position, load: np.cos(2 * np.pi * position / PITCH),
)
class Cogging(Shaped):
    name = "cogging"
    equation = "τ = Cg cos(2π q/0.35)"
    source = "data sheet of the motor"
    units = (("Cg", "N·m", "N"),)
    usual = (PITCH, 0.02)  # which no search changes

    def curves(self, at):
        return [np.cos(2 * np.pi * at.travel / self.shape(at.robot, at.axis))]

'''  # fmt: skip

LADDER = """
[[models]]
name = "with cogging"
effects = ["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia",
           "cogging@elbow"]
"""


@pytest.fixture(scope="module")
def folder(succeeds, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plugin")
    (folder / "cogging.py").write_text(PLUGIN)
    (folder / "ladder.toml").write_text(LADDER)
    for name in "abcd":
        words = ["--seed", ord(name), "--hide", "cogging@elbow=0.1", "--noise", "torque=0.01"]
        words += ["--samples", 400, "--plugin", folder / "cogging.py"]
        motion = name if name in "ab" else "random"
        succeeds("simulate", "two-link", motion, *words, "--out", folder / f"{name}.csv")
        forget("cogging")
    return folder


@pytest.fixture
def run(folder, succeeds):
    """A function (verb, words) -> what a command says that knows the effect."""
    yield (
        lambda verb, *words: (
            succeeds(verb, "two-link", *words, "--plugin", folder / "cogging.py").output
        )
    )
    forget("cogging")


@pytest.fixture
def logs(folder):
    """Words that give logs to fit and one to hold out."""
    fitted = [folder / f"{name}.csv" for name in "abc"]
    return *fitted, "--validate", folder / "d.csv", "--quick"


@pytest.mark.pictures
def test_a_diagnosis_names_it_and_its_page_draws_it_over_position(folder, logs, run):
    page = folder / "gap.html"
    found = folder / "gap.json"
    few = "cogging,position_ripple,gear_ripple,stribeck_friction"
    run("diagnose", *logs, "--effects", few, "--report", page, "--json", found)
    effects = json.loads(found.read_text())["effects"]
    assert [(e["effect"], e["joints"]) for e in effects] == [("cogging", ["elbow"])]
    assert "position [rad]" in page.read_text()


def test_a_ladder_has_it_and_an_export_is_read_back(folder, logs, run):
    result = folder / "result.json"
    out = folder / "fitted.xml"
    run("analyze", *logs, "--ladder", folder / "ladder.toml", "--json", result)
    content = json.loads(result.read_text())
    fitted = content["physical"]["parameters"]["elbow.Cg"]
    shown = {p["name"]: p["value"] for p in content["full_parameters"]}
    assert shown["elbow.Cg"] == pytest.approx(fitted, rel=0.05)
    forget("cogging")
    said = run("export", result, "--out", out)
    assert "cannot hold cogging (elbow.Cg)" in " ".join(said.split())
    assert Robot.load(out).nominal["elbow.Cg"] == fitted


def test_pruning_keeps_it_and_its_model_file_is_read_again(folder, logs, run):
    model = folder / "pruned.toml"
    found = folder / "pruned.json"
    run("prune", *logs, "--ladder", folder / "ladder.toml", "--out", model, "--json", found)
    assert "cogging@elbow" in model.read_text()
    kept = json.loads(found.read_text())
    assert "elbow.Cg" in {p["name"] for p in kept["parameters"]}


def test_a_motion_separates_it_from_another(folder, run):
    pair = ["--separate", "cogging@elbow", "--separate", "joint_stiffness@elbow"]
    run("excite", *pair, "--set", "evaluations=50", "--out", folder / "motion.json")
    assert (folder / "motion.json").exists()


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("x = 1\n", "registers no effect"),
        ("a = 1\nb = a / 0\n", "fails in line 2 (ZeroDivisionError"),
        (PLUGIN.replace("return [", "return at.travel\n        ["), "gives a curve of shape"),
    ],
)
def test_a_plugin_that_is_none_is_refused_in_a_sentence(command, tmp_path, text, sentence):
    path = tmp_path / "own.py"
    path.write_text(text)
    out = tmp_path / "out.csv"
    pair = ["--separate", "cogging", "--separate", "joint_stiffness"]
    result = command("excite", "two-link", *pair, "--out", out, "--plugin", path)
    forget("cogging")
    assert result.exit_code == 2
    assert sentence in " ".join(result.output.split())
    assert not out.exists()
