"""The same preparation, engine and progress options in every verb; `--quick` overrides nothing."""

import importlib
import inspect
import io
from types import SimpleNamespace

import pytest
import typer
from rich.console import Console

import identifiability
from identifiability.cli import app, common, options

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


def arguments_of(verb, monkeypatch, *words):
    """What the library is called with by a command line."""
    seen = {}

    class StoppedError(Exception):
        pass

    def called(*_args, **options):
        seen.update(options)
        raise StoppedError

    robot = SimpleNamespace(check_stands=lambda _what: None)
    monkeypatch.setattr(options.Machine, "load", lambda *_: robot)
    monkeypatch.setattr("identifiability.logs.formats.reader.check_there", lambda _path: None)
    module, name = {
        "analyze": ("identifiability.workflows.analyze", "analyze"),
        "diagnose": ("identifiability.workflows.diagnose", "diagnose"),
        "calibrate": ("identifiability.workflows.calibrate.calibration", "calibrate"),
    }[verb]
    if verb == "calibrate":
        first = importlib.import_module("identifiability.workflows.analyze")
        monkeypatch.setattr(first, "analyze", lambda *_a, **o: seen.update(analysis=o))
    monkeypatch.setattr(importlib.import_module(module), name, called)
    with pytest.raises(StoppedError):
        typer.main.get_command(app)([verb, "two-link", "run.pq", *words], standalone_mode=False)
    return seen


@pytest.mark.parametrize("verb", ["analyze", "diagnose", "calibrate"])
def test_preparation_and_workers_reach_the_library(verb, monkeypatch):
    seen = arguments_of(verb, monkeypatch, "--cutoff", "7", "--workers", "2")
    how = seen.get("analysis", seen)["preparation"]
    assert how.cutoff == 7.0
    assert type(seen["engine"]).__name__ == "Processes"
    assert arguments_of(verb, monkeypatch).get("preparation") is None


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
