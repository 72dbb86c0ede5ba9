"""Every help shows what to type, and names the effects that its options take."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner

import identifiability
from identifiability.cli import app

ROOMS = [p.parent.name for p in Path(identifiability.__file__).parent.glob("*/__init__.py")]
VERBS = dict(get_command(app).commands)


def told(verb):
    done = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "200"})
    assert done.exit_code == 0
    return " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize("verb", VERBS)
def test_every_help_shows_a_line_to_type_and_explains_each_option(verb):
    text = told(verb)
    assert f"identifiability {verb}" in text
    for parameter in VERBS[verb].params:
        assert parameter.name == "help" or parameter.help, parameter.name
    assert re.findall(rf"\b(?:{'|'.join(ROOMS)})\.[a-z_]+\.[a-z_]+", text) == []  # no module
