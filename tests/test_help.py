"""Every help shows what to type, and names the effects that its options take."""

import re
import tomllib
from pathlib import Path
from string import Template

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner

import identifiability
from identifiability.cli import app
from identifiability.cli.options import help_numbers
from identifiability.estimation.differences import DRIFT
from identifiability.foundation.defaults import DEFAULTS
from identifiability.workflows.predict import WINDOW

ROOMS = [p.parent.name for p in Path(identifiability.__file__).parent.glob("*/__init__.py")]
VERBS = dict(get_command(app).commands)


def told(verb):
    done = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "200"})
    return " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize("verb", VERBS)
def test_every_help_shows_a_line_to_type_and_explains_each_option(verb):
    text = told(verb)
    for parameter in VERBS[verb].params:
        assert parameter.name == "help" or parameter.help, parameter.name
    assert re.findall(rf"\b(?:{'|'.join(ROOMS)})\.[a-z_]+\.[a-z_]+", text) == []  # no module


#: Two screens of a terminal [lines].
TWO_SCREENS = 75

#: Numbers in the prose of the help that no constant holds, with what they are.
OTHERS = {
    r"3-rps|3-RPS|joint_2": "names",
    r"95 %": "the level of every interval",
    r"0 for none|is 0 where|exit code is 1": "what a value means",
    r"Swevers 1997": "a source",
    r"Such as 3, table3, figure4": "tables of the paper",
    r"571, 595, 601": "trajectories of the paper",
    r"'fer_joint.*?1'": "a regular expression",
}
#: Numbers in the prose of the help that a constant holds which help cannot import quickly.
MIRRORED = {
    r"differs by up to 3 %": lambda: round(100 * np.sqrt(2) * DRIFT) == 3,
    r"windows of one second": lambda: WINDOW == 1.0,
}


def prose_of(part):
    """Every text of the help without lines to type, code and what constants fill in."""
    if isinstance(part, dict):
        for inner in part.values():
            yield from prose_of(inner)
    elif isinstance(part, str):
        lines = re.sub(r"```.*?```", "", part, flags=re.DOTALL).splitlines()
        shown = " ".join(line for line in lines if not line.startswith("    "))
        yield re.sub(r"`[^`]*`", "", shown)


def stray_numbers(prose):
    """Numbers of a text that are neither filled in nor known."""
    return re.findall(r"\S*\d\S*", re.sub("|".join([*OTHERS, *MIRRORED]), "", prose))


def test_every_number_of_the_help_comes_from_the_code():
    text = (Path(identifiability.__file__).parent / "cli/help.toml").read_text()
    assert stray_numbers("by default 2000, or $refits_quick if quick") == ["2000,"]
    content = tomllib.loads(text)
    every = " ".join([*prose_of(content["verbs"]), *prose_of(content["options"])])
    assert stray_numbers(every) == []
    assert all(re.search(known, every) for known in [*OTHERS, *MIRRORED])
    assert all(holds() for holds in MIRRORED.values())
    assert {*Template(text).get_identifiers()} <= {*help_numbers()}


def test_the_refits_that_the_help_states_are_those_that_run(arm_log):
    for quick, refits in ((False, DEFAULTS.refits), (True, DEFAULTS.refits_quick)):
        result = identifiability.analyze("two-link", arm_log, quick=quick)
        assert result.settings["replicates"] == refits
    stated = f"by default {DEFAULTS.refits:,}, or {DEFAULTS.refits_quick} if"
    assert stated in told("analyze")


@pytest.mark.parametrize("verb", VERBS)
def test_every_help_begins_with_examples_and_fits_on_two_screens(verb):
    done = CliRunner().invoke(app, [verb, "--help"], env={"COLUMNS": "80"})
    lines = done.output.splitlines()
    examples = [line.startswith(f"  identifiability {verb}") for line in lines]
    first = examples.index(True)
    assert first < 9
    assert len(lines) <= TWO_SCREENS
