"""The command and the scripts say what they do and end with the right code."""

from importlib import import_module
from pathlib import Path

import pytest
import table_1_base_parameters
from paper_study import command as study_command
from paper_study.result import StudyCheck

FOLDER = Path(study_command.__file__).resolve().parents[1]

#: The module; its name in `identifiability.cli` is the command.
module = import_module("identifiability.cli.verbs")


@pytest.fixture
def run(command):
    return lambda *words: command("paper", *words)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Make the package one that `pip install .` has copied to another folder."""
    site = tmp_path / "site" / "identifiability" / "cli" / "verbs.py"
    monkeypatch.setattr(module, "__file__", str(site))


def test_a_failed_required_check_ends_with_1(run, tmp_path, monkeypatch):
    wrong = StudyCheck("sky", "green", "blue", "exact", passed=False)
    monkeypatch.setattr(table_1_base_parameters, "structure_checks", lambda *_: [wrong])
    out = run("1", "--quick", "--out", tmp_path)
    assert out.exit_code == 1
    assert "sky: green" in out.output
    assert "1 of 1 studies of the paper fail" in (tmp_path / "index.html").read_text()


def test_outside_a_checkout_it_says_where_the_studies_are(run, tmp_path, monkeypatch, installed):
    monkeypatch.chdir(tmp_path)
    out = run("3")
    assert out.exit_code == 2
    said = " ".join(out.stderr.split())
    assert "part of the source checkout" in said
    assert f"git clone {module.SOURCE}" in said
    assert said.count(". ") == 0


@pytest.mark.parametrize("folder", [".", "studies/paper_data"])
def test_a_package_that_is_installed_elsewhere_finds_the_studies_of_the_working_folder(
    folder, run, tmp_path, monkeypatch, installed
):
    monkeypatch.chdir(FOLDER.parent / folder)
    out = run("slips", "--quick", "--set", "workers=1", "--out", tmp_path / "pages")
    assert out.exit_code == 0, out.output
    assert (tmp_path / "pages" / "paper_slips.html").exists()


@pytest.mark.parametrize("project", ["[project]\nname = 'mine'\n", "name = [", None])
def test_studies_of_another_project_are_not_run(project, run, tmp_path, monkeypatch, installed):
    (tmp_path / "studies").mkdir()
    for name in ("registry.py", "__main__.py"):
        (tmp_path / "studies" / name).write_text("raise SystemExit('ran')\n")
    if project is not None:
        (tmp_path / "pyproject.toml").write_text(project)
    monkeypatch.chdir(tmp_path)
    out = run("3")
    assert out.exit_code == 2
    assert "part of the source checkout" in " ".join(out.stderr.split())


def test_an_unknown_table_is_one_sentence(run):
    out = run("17")
    assert out.exit_code == 2
    assert "no study '17'" in out.stderr
