"""The command line teaches itself: shells complete it, and its help says what to do."""

import os
import subprocess
import sys

import pytest

from identifiability.robot.locate import shipped_robots

START = "import sys; sys.argv[0] = 'identifiability'; from identifiability.cli import main; main()"


def run(*words: str, **environment: str) -> str:
    out = subprocess.run(
        [sys.executable, "-c", START, *words],
        check=False, capture_output=True, text=True, env={**os.environ, **environment},
    )  # fmt: skip
    assert out.returncode == 0, out.stderr
    return out.stdout


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("identifiability pr", {"predict", "prune"}),
        ("identifiability analyze --rep", {"--replicates", "--report"}),
        ("identifiability analyze two", {"two-link"}),
        ("identifiability analyze ", set(shipped_robots())),
    ],
)
def test_a_shell_is_offered_what_can_follow(typed, offered):
    words = typed.split(" ")
    out = run(
        _IDENTIFIABILITY_COMPLETE="complete_bash",
        COMP_WORDS=typed,
        COMP_CWORD=str(len(words) - 1),
    )
    assert set(out.split()) == offered
