"""Nothing printed comes from docstrings: ``python -OO``, which has none, prints the same."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from identifiability.cli.options import helps
from identifiability.robot import Robot
from identifiability.simulation import simulate
from identifiability.simulation.motion import find_motion


def printed(*words, cwd):
    """What a command prints without docstrings, and with them."""

    def run(*flags):
        command = [sys.executable, *flags, "-m", "identifiability", *words]
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=cwd)
        return done.stdout

    with ThreadPoolExecutor(2) as pool:
        return tuple(pool.map(lambda flags: run(*flags), (("-OO",), ())))


@pytest.mark.parametrize("verb", ["", *helps()["verbs"]])
def test_every_help_is_printed_without_docstrings(verb, tmp_path):
    without, usual = printed(*verb.split(), "--help", cwd=tmp_path)
    assert without == usual
    assert "Usage" in usual


@pytest.mark.parametrize("verb", ["analyze", "diagnose"])
def test_every_answer_is_printed_without_docstrings(verb, tmp_path):
    robot = Robot.load("two-link")
    simulate(robot, find_motion(robot, "random", 400), noise="torque=0.02").write(
        tmp_path / "run.csv"
    )
    without, usual = printed(verb, "two-link", "run.csv", "--quick", cwd=tmp_path)
    assert without == usual
    assert usual
