"""What is not there, or has other columns, is refused before anything large is imported."""

from __future__ import annotations

import subprocess
import sys

import pytest

from identifiability.foundation.errors import LogError
from identifiability.logs.conventions import Conventions
from identifiability.logs.header import check_header
from identifiability.robot import Robot
from identifiability.robot.locate import shipped_folder

#: Each takes a tenth of a second or more to import.
LARGE = ("pandas", "scipy.stats", "matplotlib", "cvxpy", "mujoco", "joblib")


@pytest.mark.parametrize(
    ("words", "sentence", "also"),
    [
        (["analyze", "missing.urdf", "run.csv"], "There is no robot file", ["pinocchio"]),
        (["diagnose", "two-link", "no.csv"], "There is no log file", ["pinocchio"]),
        (["predict", "two-link", "result.json", "no.mcap"], "There is no bag", ["pinocchio"]),
        (["prune", "six-dof-arm", "run.csv"], "numbers its joints otherwise", []),
    ],
)
def test_it_is_refused_before_anything_large_is_imported(words, sentence, also, tmp_path):
    (tmp_path / "run.csv").write_text("t,q1,tau1\n0,0,0\n")
    script = f"""
import sys
from identifiability.cli import app
try:
    app({words!r})
except SystemExit as end:
    print(end.code, *(name for name in {(*LARGE, *also)!r} if name in sys.modules))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert sentence in " ".join(done.stderr.split())
    assert done.stdout.split() == ["2"]


@pytest.mark.parametrize("robot", ["six-dof-arm", "3-rps"])
def test_what_can_be_read_passes(robot):
    known = Conventions.of(Robot.load(robot))
    for log in shipped_folder().glob(f"{robot}/logs/*.csv"):
        check_header(log, known)


def test_a_header_is_refused_as_the_reader_would(tmp_path):
    known = Conventions.of(Robot.load("two-link"))
    log = tmp_path / "log.csv"
    log.write_text("t,shoulder.q,shoulder.tau,elbow.q\n0,0,0,0\n")
    with pytest.raises(LogError, match=r"elbow\.tau"):
        check_header(log, known)
    log.write_text("t;shoulder.q;shoulder.tau;elbow.q;elbow.tau\n0,0;0,1;0;0;0\n")
    check_header(log, known)  # semicolons and decimal commas
    log.write_text('t,"odd\nname",shoulder.q\n')
    check_header(log, known)  # left to the reader
