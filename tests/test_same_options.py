"""The same preparation, engine and progress options in every verb; `--quick` overrides nothing."""

import inspect
import re
from types import SimpleNamespace
from typing import Literal, get_origin, get_type_hints

import pytest
import typer

import identifiability
from identifiability.cli import app, options, verbs
from identifiability.foundation.engines import choose_engine

#: Verbs that take logs, and options and settings that mean the same in each.
VERBS = ("analyze", "prune", "diagnose", "calibrate", "excite", "inspect")
SHARED = ("set", "map", "seed", "lock", "sidecar", "plugin")
SETTINGS = ("derivatives", "cutoff", "decimate", "workers", "scheduler",
            "time_unit", "angles", "base")  # fmt: skip


#: Verbs whose options are those of the function of their name.
OPTIONS = ("analyze", "prune", "diagnose", "excite", "calibrate", "simulate", "inspect", "payload",
           "compare")  # fmt: skip


@pytest.fixture(scope="module")
def commands():
    return typer.main.get_command(app).commands


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_them(verb, commands):
    known = {p.name: p for p in commands[verb].params}
    usual = {p.name: p for p in commands["analyze"].params}
    for name in set(SHARED) - ({"seed"} if verb == "inspect" else set()):  # nothing is random
        assert known[name].help == usual[name].help
        assert known[name].opts == usual[name].opts
    for name in SETTINGS:
        assert commands[verb].settings[name] == commands["analyze"].settings[name]


def test_no_verb_has_more_than_seventeen_options(commands):
    for command in commands.values():
        own = [p for p in command.params if p.param_type_name == "option" and p.name != "help"]
        assert len(own) <= 17


@pytest.mark.parametrize(
    "words, sentence",
    [
        (["cutof=3"], "--set cutof=3 is no KEY=VALUE of base, .*, did you mean 'cutoff'?"),
        (["cutoff"], "--set cutoff is no KEY=VALUE"),
        (["cutoff=abc"], "cutoff must be a number above 0, not 'abc'"),
        (["decimate=2.5"], "decimate must be a whole number of at least 1, not '2.5'"),
    ],
)
def test_a_setting_that_is_none_is_one_sentence(words, sentence, command):
    typed = [word for each in words for word in ("--set", each)]
    done = command("analyze", "two-link", __file__, *typed)
    assert done.exit_code == 2
    assert re.search(sentence.replace("?", r"\?"), " ".join(done.stderr.split()))


def test_the_sidecar_sets_what_no_option_does(tmp_path, monkeypatch):
    sidecar = tmp_path / "robot.toml"
    sidecar.write_text('[preparation]\ncutoff = 9\nderivatives = "butterworth"\n[run]\nworkers = 2')
    words = ["--sidecar", str(sidecar)]
    how = arguments_of("analyze", monkeypatch, *words)["preparation"]
    assert (how.cutoff, how.derivatives) == (9, "butterworth")
    seen = arguments_of("analyze", monkeypatch, *words, "--set", "cutoff=7")
    assert (seen["preparation"].cutoff, seen["engine"].workers) == (7, 2)
    sidecar.write_text("[preparation]\ncutof = 9")
    with pytest.raises(SystemExit):
        arguments_of("analyze", monkeypatch, *words)


@pytest.mark.parametrize(
    "holder, function",
    [
        *((getattr(verbs, verb).function, getattr(identifiability, verb)) for verb in OPTIONS),
        (options.Fitted, identifiability.analyze),
        (options.Fitted, identifiability.prune),
        (options.Derived, identifiability.Preparation),
        (options.Place, choose_engine),
    ],
)
def test_options_are_what_their_function_takes(holder, function):
    library = inspect.signature(function).parameters
    kinds = get_type_hints(holder)
    theirs = get_type_hints(inspect.unwrap(function) if inspect.isfunction(function) else function)
    known = [f for f in options.options_of(holder) if f.name in library and f.name != "logs"]
    assert known
    for field in known:
        assert (field.default or None) == (library[field.name].default or None) or (
            field.default is inspect.Parameter.empty
        )
        if get_origin(kinds[field.name]) is Literal:
            assert kinds[field.name] == theirs[field.name]


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
    if verb == "calibrate":
        first = lambda *_a, **o: seen.update(analysis=o)  # noqa: E731
        monkeypatch.setattr(identifiability, "analyze", first)
    monkeypatch.setattr(identifiability, verb, called)
    with pytest.raises(StoppedError):
        typer.main.get_command(app)([verb, "two-link", __file__, *words], standalone_mode=False)
    return seen


@pytest.mark.parametrize(
    "verb, words, name, usual, quick, given",
    [
        ("analyze", ["--posterior"], "posterior", False, False, True),
        ("calibrate", ["--replicates", "50"], "replicates", None, None, 50),
    ],
)
def test_quick_overrides_no_explicit_option(monkeypatch, verb, words, name, usual, quick, given):
    assert arguments_of(verb, monkeypatch)[name] == usual
    assert arguments_of(verb, monkeypatch, "--quick")[name] == quick
    assert arguments_of(verb, monkeypatch, "--quick", *words)[name] == given


@pytest.mark.parametrize("verb", ["analyze", "diagnose", "calibrate"])
def test_preparation_and_workers_reach_the_library(verb, monkeypatch):
    seen = arguments_of(verb, monkeypatch, "--set", "cutoff=7", "--set", "workers=2")
    how = seen.get("analysis", seen)["preparation"]
    assert how.cutoff == 7.0
    assert type(seen["engine"]).__name__ == "Processes"
    assert arguments_of(verb, monkeypatch).get("preparation") is None
