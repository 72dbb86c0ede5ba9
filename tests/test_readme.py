"""The README is true: its Python runs in order, its commands and their options exist."""

from __future__ import annotations

import contextlib
import re
import shlex
import sys
from functools import partial
from pathlib import Path

import pytest
import typer

import identifiability
from identifiability.cli import app

README = Path(__file__).resolve().parents[1] / "README.md"
COMMANDS = vars(typer.main.get_command(app))["commands"]


def blocks(language: str) -> list[tuple[int, str]]:
    """Line and text of the fenced blocks in a language."""
    text = README.read_text(encoding="utf-8")
    found = re.finditer(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [(text.count("\n", 0, m.start()) + 2, m[1]) for m in found]


def shown_commands() -> list[str]:
    """Every ``identifiability …`` of the README and of the commands' own help."""
    told = [text for _, text in blocks("console")]
    told += [c.help or "" for c in COMMANDS.values()]
    lines = [line.strip().removeprefix("$ ") for text in told for line in text.splitlines()]
    return [line for line in lines if line.startswith("identifiability ")]


@pytest.fixture(
    scope="module",
    params=[20, pytest.param(200, marks=pytest.mark.everything)],
    ids="{} times".format,
)
def folder(request, tmp_path_factory) -> Path:
    """An empty folder in which the Python of the README has run, from top to bottom.

    Pruning resamples less often than it would by itself, but for one run of everything.
    """
    place = tmp_path_factory.mktemp("readme")
    known: dict[str, object] = {}
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.chdir(place),
        contextlib.redirect_stdout(place.joinpath("said").open("w")),
    ):
        few = partial(identifiability.prune, replicates=request.param)
        patch.setattr(identifiability, "prune", few)
        for line, text in blocks("python"):
            # Padded, so that a traceback names the line of the README.
            exec(compile("\n" * (line - 1) + text, str(README), "exec"), known)
        sys.stdout.close()
    return place


def test_the_python_of_the_readme_runs_in_order(folder):
    assert len(blocks("python")) >= 3
    assert (folder / "pruning.html").is_file()


def test_the_tutorial_leads_from_a_log_to_a_decision_in_ten_lines(folder):
    _, tutorial = blocks("python")[0]
    assert "# A decision" in tutorial
    assert len([line for line in tutorial.splitlines() if line.strip()]) <= 10
    assert (folder / "report.html").stat().st_size > 100_000
    decision = (folder / "said").read_text(encoding="utf-8").splitlines()[0]
    assert "are identifiable" in decision
    assert "motion that it has not seen" in decision


@pytest.mark.parametrize("line", sorted(set(shown_commands())))
def test_a_command_that_is_shown_can_be_typed(line):
    """Arguments and options are parsed as on the command line, and nothing is run."""
    _, name, *words = shlex.split(line.split(" | ")[0], comments=True)
    assert name in COMMANDS or name.startswith("--"), f"there is no command '{name}'"
    if name in COMMANDS:
        COMMANDS[name].make_context(name, words)


def test_links_inside_the_project_lead_somewhere():
    text = README.read_text(encoding="utf-8")
    paths = re.findall(r"`((?:identifiability|models|studies)/[\w./-]+\.\w+)`", text)
    paths += [p for p in re.findall(r"\]\(([^)#]+)\)", text) if not p.startswith("http")]
    assert paths
    for path in paths:
        assert (README.parent / path).exists(), path
