"""A study stands in a folder: `case.toml` says what the command line would have said."""

import json

import numpy as np
import pytest

from identifiability import Case, Noise, new_study, simulate
from identifiability.simulation import random_trajectory

HOSTILE = (
    ('robot = "nowhere.xml"', "nowhere.xml"),
    ("robot = 5", "'robot'"),
    ('logs = ["gone.csv"]', "There is no log file"),
    ('logs = "run1.csv"', "'logs'"),
    ('loaded = "run1.csv"', "'loaded'"),
    ('lods = ["run1.csv"]', "did you mean 'logs'"),
    ("[settings]\ncut_off = 10", "did you mean 'cutoff'"),
    ("[settings]\ncutoff = -1", "settings.cutoff"),
    ("[settings]\nangles = 'gon'", "settings.angles"),
    ("masses = {link9 = [1, 2]}", "did you mean 'link"),
    ("masses = {link1 = [2, 1]}", "lower limit"),
    ("masses = {link1 = [nan, 2]}", "masses.link1"),
    ('logs = ["a\\u0000.csv"]', "null character"),
    ('sidecar = "; touch hit; #"', "touch hit"),
    ('logs = ["$(touch hit).csv"]', "There is no log file"),
    ("lock = [\"__import__('os')\"]", "__import__"),
    ("robot = [", "TOML"),
    ("plugin = 'evil.py'", "plugin"),
)


def append(folder, text):
    with (folder / "case.toml").open("a") as file:
        file.write(text)


@pytest.fixture
def folder(tmp_path, monkeypatch, two_link):
    made = new_study(tmp_path / "study", "two-link").folder
    robot = two_link.with_values({"link2.m": 3.0, "elbow.Fc": 1.0})
    for k in (1, 2, 3):
        rng = np.random.default_rng(k)
        motion = random_trajectory(robot, rng, samples=400)
        noise = Noise(additive=0.05, correlation=0.9)
        simulate(robot, motion, noise=noise, rng=rng).write(made / f"run{k}.csv")
    monkeypatch.chdir(made)
    return made


def result_of(folder, name="result.json"):
    return json.loads((folder / name).read_text())


def test_verbs_need_no_arguments_in_the_folder_of_a_case(folder, command):
    assert "2 logs to fit and 1 held-out log" in command("inspect").output
    assert "inspect robot.xml run1.csv" in command("inspect", "robot.xml").output
    for verb in ("analyze --quick", "predict", "export", "compare", "diagnose --quick"):
        done = command(*verb.split())
        assert done.exit_code == 0, done.output
    typed = command("payload", ".", "result.json", "run3.csv").output
    assert "payload robot.xml result.json run3.csv --body" in next_line(typed)
    append(folder, 'loaded = ["run3.csv"]\n')
    weighed = command("payload", "--json", "load.json")
    assert weighed.exit_code == 0, weighed.output
    load = result_of(folder, "load.json")
    assert (load["logs"], load["without"]) == (["run3.csv"], ["run1.csv", "run2.csv"])
    assert command("simulate").exit_code == 0
    assert "along random" in command("simulate", "--out", "b.csv").output
    assert (folder / "simulated.csv").is_file()
    hashes = [key for key in result_of(folder)["provenance"] if key.startswith("sha256 run")]
    assert hashes == [f"sha256 run{k}.csv" for k in (1, 2, 3)]
    assert (folder / "fitted.xml").is_file()


def next_line(said):
    """Return the line that a command proposes to type next."""
    (line,) = (row for row in said.splitlines() if row.startswith("Next "))
    return line.partition(": ")[2]


def test_proposed_lines_are_short_where_the_case_says_the_same(folder, command, monkeypatch):
    append(folder, "[settings]\ncutoff = 9.0\n")
    assert next_line(command("inspect").output) == "identifiability analyze --report report.html"
    line = next_line(command("analyze", "--quick").output)
    assert line.startswith("identifiability ")
    assert not {"robot.xml", "run1.csv", "cutoff=9"} & {*line.split()}
    assert command(*line.split()[1:], "--quick").exit_code == 0
    other = next_line(command("inspect", "run1.csv", "run2.csv").output)
    assert "robot.xml run1.csv --validate run2.csv --report" in other
    monkeypatch.chdir(folder.parent)
    assert next_line(command("inspect", "study").output).startswith("identifiability analyze study")


def test_the_command_line_goes_before_the_case_and_the_case_before_the_sidecar(folder, command):
    (folder / "robot.toml").write_text("[preparation]\ncutoff = 7.0\ndecimate = 2\n", "utf-8")

    def cutoff(*words):
        assert command("analyze", *words, "--quick").exit_code == 0
        return result_of(folder)["fit"]["preparation"]

    assert cutoff()["cutoff"] == pytest.approx(7.0)
    append(folder, "[settings]\ncutoff = 9.0\n")
    found = cutoff()
    assert (found["cutoff"], found["decimate"]) == (pytest.approx(9.0), 2)
    assert cutoff("--set", "cutoff=8")["cutoff"] == pytest.approx(8.0)
    done = command("analyze", ".", "run3.csv", "--validate", "none", "--quick", "--json", "a.json")
    assert done.exit_code == 0, done.output
    logs = [key for key in result_of(folder, "a.json")["provenance"] if "run" in key]
    assert logs == ["sha256 run3.csv"]


def test_a_case_is_read_from_elsewhere_and_from_python(folder, command, tmp_path, monkeypatch):
    append(folder, "[masses]\nlink2 = [2.4, 2.6]\n[settings]\ndecimate = 3\n")
    monkeypatch.chdir(tmp_path)
    assert "link2 2.4 … 2.6 kg" in command("inspect", "study").output
    case = Case.load("study")
    assert case.logs == ("study/run1.csv", "study/run2.csv")
    assert case.preparation.decimate == 3
    (bound,) = case.robot.bounds
    assert (bound.bodies, bound.mass) == (("link2",), (2.4, 2.6))


@pytest.mark.parametrize("line, says", HOSTILE)
def test_a_wrong_case_file_is_refused_in_one_sentence(line, says, folder, command):
    key = line.partition(" ")[0]
    text = 'robot = "robot.xml"\nlogs = ["run1.csv"]\n'
    kept = [row for row in text.splitlines() if not row.startswith(key)]
    first = [*kept, line] if not line.startswith("[") else ['robot = "robot.xml"', line]
    (folder / "case.toml").write_text("\n".join(first), "utf-8")
    done = command("analyze", "--quick")
    said = done.output.splitlines()
    assert done.exit_code == 2
    assert len(said) == 1
    assert says in said[0]
    assert not (folder / "hit").exists()


def test_a_folder_without_a_case_file_is_no_case(tmp_path, rejected):
    with rejected(r"case\.toml"):
        Case.load(tmp_path)
