"""The study of hostile files and faults sees harm where there is some; a short form of it."""

import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(STUDIES))
    return importlib.import_module("hostile_days")


HARM = """
import sys, os
from pathlib import Path
from hostile import judge
from hostile.case import Hostile
import identifiability.cli

def main():
    word = sys.argv[1]
    if word == "fetch":
        import socket
        socket.socket().connect_ex(("127.0.0.1", 9))
    elif word == "run":
        os.system("true")
    elif word == "write":
        Path("../elsewhere").write_text("")
    elif word == "escape":
        print("\\x1b[2J")
    elif word == "tell":
        print(judge.SECRET)
    elif word == "crash":
        os.abort()
    elif word == "trace":
        raise ValueError
    elif word == "hold":
        held = b"x" * 1_100_000_000
    elif word == "good":
        print("Error: this is refused.")
        raise SystemExit(2)
    elif word == "two":
        print("Error: this is\\nrefused.")
        raise SystemExit(2)

identifiability.cli.main = main
for word in sys.argv[1:]:
    case = Hostile("csv", word, "x", lambda folder: None, (word,), False)
    found = judge.judge(case, Path(os.environ["GOOD"]), 0.0)
    print(word, found.result, "; ".join(found.problems))
"""

FOUND = {
    "fetch": "socket.connect",
    "run": "os.system",
    "write": "left or wrote elsewhere",
    "escape": "control characters",
    "tell": "printed what stands in another file",
    "crash": "ended by SIGABRT",
    "trace": "traceback",
    "hold": " MB",
    "two": "no single line",
}


@pytest.mark.everything  # as what it judges
def test_the_judge_sees_every_harm(tmp_path):
    words = [sys.executable, "-c", HARM, "good", *FOUND]
    env = os.environ | {"GOOD": str(tmp_path), "PYTHONPATH": os.pathsep.join(
        [str(STUDIES), str(STUDIES.parent)])}  # fmt: skip
    done = subprocess.run(words, env=env, check=True, capture_output=True, text=True)
    lines = {line.partition(" ")[0]: line for line in done.stdout.splitlines()}
    assert lines.pop("good") == "good refused "
    assert set(lines) == set(FOUND)
    for word, problem in FOUND.items():
        assert lines[word].startswith(f"{word} failed"), lines[word]
        assert problem in lines[word], lines[word]


@pytest.mark.everything
def test_there_are_more_than_500_files_and_200_faults(study, tmp_path):
    names = ("t", "shoulder.q", "elbow.q", "shoulder.dq", "elbow.dq", "shoulder.tau", "elbow.tau")
    frame = importlib.import_module("pandas").DataFrame({n: np.zeros(30) for n in names})
    fit = {"robot": {"name": "a"}, "fit": {"names": ["x"], "values": [1.0]}}
    (tmp_path / "fit.json").write_text(json.dumps(fit))
    groups = [(g[0].reader, len(g)) for g in study.list_files(frame, tmp_path / "fit.json")]
    assert sum(size for _, size in groups) > 500
    assert sum(count for *_, count in study.FAULTS) >= 200


def test_the_page_tells_harm(study, tmp_path):
    file = study.Outcome("csv", "a line", "failed", 6.0, 7.0, 90.0, "", ("6.0 s of CPU",))
    fault = study.Fault("signal", "analyze", "SIGINT", 1.0, ("a half file",))
    study.write([file], [fault], tmp_path / "days.json")
    page = " ".join((tmp_path / "days.html").read_text().split())
    assert "a half file" in page
    assert "1 did harm" in study.state([file], [])
    told = study.state([file], [fault])
    assert "0 results lost, 1 files half-written" in told
    assert "1 over their limit, 0 other harm" in told
    assert json.loads((tmp_path / "days.json").read_text())["faults"][0]["what"] == "SIGINT"


@pytest.mark.everything
def test_a_short_form_of_the_study_finds_no_harm(tmp_path):
    out = tmp_path / "days.json"
    words = [sys.executable, STUDIES / "hostile_days.py", "--quick", "--out", str(out)]
    env = os.environ | {"PYTHONPATH": str(STUDIES.parent)}
    subprocess.run(words, env=env, check=True, capture_output=True)
    found = json.loads(out.read_text())
    assert not [o for o in found["files"] + found["faults"] if o["problems"]]
