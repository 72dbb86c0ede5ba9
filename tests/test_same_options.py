"""The same preparation, engine and progress options in every verb; `--quick` overrides nothing."""

import inspect
import io

import pytest
import typer
from rich.console import Console

import identifiability
from identifiability.cli import app, common

#: Verbs that take logs, and options that mean the same in each.
VERBS = ("analyze", "prune", "diagnose", "calibrate", "excite", "inspect")
SHARED = ("derivatives", "cutoff", "period", "harmonics", "decimate", "engine", "workers", "map",
          "scheduler", "resume", "time_unit", "seed", "lock", "sidecar", "plugin")  # fmt: skip


@pytest.fixture(scope="module")
def commands():
    return typer.main.get_command(app).commands


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_them(verb, commands):
    known = {p.name: p for p in commands[verb].params}
    usual = {p.name: p for p in commands["analyze"].params}
    own = {"excite": {"harmonics"}, "inspect": {"seed"}}  # its motion's; nothing is random
    for name in set(SHARED) - own.get(verb, set()):
        assert known[name].help == usual[name].help
        assert known[name].opts == usual[name].opts


@pytest.mark.parametrize(
    ("verb", "names"),
    [
        ("analyze", "validate ladder posterior replicates seed quick"),
        ("prune", "validate ladder forbid force replicates seed quick"),
        ("diagnose", "validate model seed quick"),
        ("calibrate", "model seed quick"),
        ("payload", "without body"),
        ("inspect", "model"),
        ("compare", "ladder"),
    ],
)
def test_options_have_names_and_defaults_of_the_library(verb, names, commands):
    known = {p.name: p for p in commands[verb].params}
    library = inspect.signature(getattr(identifiability, verb)).parameters
    for name in names.split():
        assert (known[name].default or None) == (library[name].default or None)


def test_a_pipe_gets_lines_and_a_terminal_a_bar(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(common, "QUIET", 0.0)
    with common.progress() as say:
        say("reading logs", 0.0)  # refusals come here, and have one line
        say("fitting [all]", 0.1)
    assert stream.getvalue() == " 10 %  fitting [all]\n"
    with common.progress(show=False) as say:
        say("reading logs", 0.0)
        say("fitting", 0.2)
    assert "20 %" not in stream.getvalue()
    console = Console(file=stream, force_terminal=True)
    monkeypatch.setattr("rich.console.Console", lambda **_: console)
    with common.progress() as say:
        assert not isinstance(say, common.Lines)
