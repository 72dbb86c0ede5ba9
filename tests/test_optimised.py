"""Nothing printed comes from docstrings: ``python -OO``, which has none, prints the same."""

import subprocess
import sys

from identifiability.robot import Robot
from identifiability.simulation import simulate
from identifiability.simulation.motion import find_motion

#: Prints the help of every verb, and an answer.
SCRIPT = """
from identifiability.cli import app
from identifiability.cli.options import helps
words = [[*verb.split(), "--help"] for verb in ("", *helps()["verbs"])]
for line in (*words, ["analyze", "two-link", "run.csv", "--quick"]):
    try:
        app(line)
    except SystemExit as end:
        assert end.code == 0, line
"""


def test_every_help_and_an_answer_are_printed_without_docstrings(tmp_path):
    robot = Robot.load("two-link")
    log = simulate(robot, find_motion(robot, "random", 400), noise="torque=0.02")
    log.write(tmp_path / "run.csv")
    without, usual = (
        subprocess.run(
            [sys.executable, *flags, "-c", SCRIPT],
            check=True, capture_output=True, text=True, cwd=tmp_path,
        ).stdout
        for flags in (["-OO"], [])
    )  # fmt: skip
    assert without == usual
    assert usual.count("Usage") > 14
