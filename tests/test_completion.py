"""The command line teaches itself: shells complete it, and its help says what to do."""

import os
import re
import subprocess
import sys

import pytest
import typer
from typer.testing import CliRunner

from identifiability.cli import app
from identifiability.robot.locate import shipped_robots

COMMANDS = vars(typer.main.get_command(app))["commands"]
START = "import sys; sys.argv[0] = 'identifiability'; from identifiability.cli import main; main()"


def run(*words: str, **environment: str) -> str:
    out = subprocess.run(
        [sys.executable, "-c", START, *words],
        check=False, capture_output=True, text=True, env={**os.environ, **environment},
    )  # fmt: skip
    assert out.returncode == 0, out.stderr
    return out.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_gets_its_script(shell):
    script = run("--show-completion", shell, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert "identifiability" in script
    assert f"complete_{shell}" in script


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


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_shows_all_that_was_written(name):
    """Markdown swallows what looks like a tag, such as a joint in angle brackets."""
    shown = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "1000"})
    assert shown.exit_code == 0
    plain = re.sub(r"\W+", "", shown.output)
    for parameter in COMMANDS[name].params:
        written = getattr(parameter, "help", "") or ""
        assert re.sub(r"\W+", "", written) in plain, written


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_shows_how_it_is_used(name):
    text = COMMANDS[name].help
    assert name == "demo" or f"identifiability {name} " in text


def test_the_help_of_analyze_teaches():
    text = " ".join(COMMANDS["analyze"].help.split())
    for word in ("identifiable", "weak", "negligible", "not identifiable", "--validate", "report"):
        assert word in text
