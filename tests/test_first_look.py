"""What is not there is refused before anything large is imported."""

import json
import os
import re
import sys

import pytest
from typer.main import get_command

from identifiability.cli import app
from identifiability.effects import FAMILIES
from identifiability.estimation.estimate import ESTIMATORS
from identifiability.simulation.forces import hideable

#: Each takes a tenth of a second or more to import.
LARGE = ["pandas", "scipy.stats", "scipy.signal", "matplotlib", "cvxpy", "mujoco", "joblib"]


#: What is typed, and the sentence that refuses it.
REFUSED = [
    ("analyze missing.urdf run.csv", "There is no robot file"),
    ("analyze case no.csv", "There is no log file"),
    ("analyze two-link --optoin", "No such option: --optoin"),
    ("diagnose two-link no.csv", "There is no log file"),
    ("predict two-link result.json no.mcap", "There is no log file"),
    ("prune two-link no.csv", "There is no log file"),
    ("payload two-link no.json run.csv", "There is no result file"),
    ("simulate two-link no.csv --out x.csv", "no motion file"),
    ("new x --robot no.urdf", "There is no robot file"),
    ("excite no.urdf --out x.json", "There is no robot file"),
    ("compare two-link run.csv no.csv", "There is no log file"),
]

#: Verbs whose help names what is registered, where it does, and those names.
HELPED = {
    "diagnose": (r"Effects: (.*)", FAMILIES),
    "simulate": (r"Effects: (.*)", hideable()),
    "analyze": (r"method=(\S+) +Weight actuators", ESTIMATORS),
}

#: Each command in a process of its own, which has imported what every command imports.
SCRIPT = """
import json, os, sys
from identifiability.cli import app
for words, large in json.load(sys.stdin):
    for stream in (sys.stdout, sys.stderr):
        print("<next>", file=stream, flush=True)
    if not os.fork():
        try:
            app(words)
        except SystemExit as end:
            print(end.code, *(name for name in large if name in sys.modules), flush=True)
        finally:
            sys.stderr.flush()
            os._exit(0)
    os.wait()
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory, process):
    """What each command of `REFUSED` and `HELPED` writes to its two streams."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "run.csv").write_text("t,q1,tau1\n0,0,0\n")
    (folder / "result.json").write_text("{}")
    (folder / "case").mkdir()
    (folder / "case" / "case.toml").write_text('robot = "two-link"\n')
    asked = [(words.split(), [*LARGE, "numpy", "pydantic", "rich"]) for words, _ in REFUSED]
    asked += [([verb, "--help"], [*LARGE, "numpy"]) for verb in HELPED]
    asked.append((["--help"], [*LARGE, "numpy"]))
    asked = json.dumps(asked)
    done = process(
        [sys.executable, "-c", SCRIPT],
        cwd=folder, input=asked, check=True,
        env={**os.environ, "COLUMNS": "1000"},
    )  # fmt: skip
    streams = (stream.split("<next>\n")[1:] for stream in (done.stdout, done.stderr))
    return list(zip(*streams, strict=True))


@pytest.mark.parametrize("which", range(len(REFUSED)), ids=lambda k: REFUSED[k][0])
def test_it_is_refused_before_anything_large_is_imported(which, said):
    stdout, stderr = said[which]
    assert REFUSED[which][1] in " ".join(stderr.split())
    assert stdout.split() == ["2"]


@pytest.mark.parametrize("which", range(len(HELPED)), ids=list(HELPED))
def test_a_help_names_what_is_registered_and_imports_none_of_it(which, said):
    stdout, _ = said[len(REFUSED) + which]
    text, _, imported = stdout.rstrip("\n").rpartition("\n")
    assert imported == "0"
    where, names = list(HELPED.values())[which]
    assert sorted(re.findall(r"\w+", re.search(where, text)[1])) == sorted(names)


def test_the_help_imports_nothing_large(said):
    stdout, _ = said[-1]
    assert stdout.endswith("\n0\n")


#: What else the verb must be told, and options that are written.
WRITTEN = {
    "analyze": "two-link run.csv, --report --json --out",
    "prune": "two-link run.csv, --report --json --out",
    "diagnose": "two-link run.csv, --report --json --out --next",
    "calibrate": "two-link run.csv, --report --json",
    "inspect": "two-link, --report --json",
    "predict": "two-link r.json run.csv, --report --json --out",
    "payload": "two-link r.json run.csv, --report --json",
    "compare": "two-link run.csv run.csv, --report --json",
    "export": "two-link r.json, --out",
    "simulate": "two-link random, --out",
    "excite": "two-link --out m.json, --report --out",
    "demo": ", --folder",
    "paper": ", --out",
    "new": ",",
}


@pytest.mark.parametrize("verb", get_command(app).commands)
def test_a_name_of_another_format_is_refused_before_anything_is_read(
    verb, command, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    words, options = map(str.split, WRITTEN[verb].split(","))
    for option in options or [""]:
        done = command(verb, *words, *option.split(), "x.pdf")
        assert done.exit_code == 2
        assert "'x.pdf'" in done.stderr
        assert "does not end in" in done.stderr or "that of a folder" in done.stderr
        assert not list(tmp_path.iterdir())


def test_no_verb_writes_over_the_result_of_another(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    other = tmp_path / "other.json"
    for name in ("r.json", "run.csv", "m.json"):
        (tmp_path / name).touch()
    other.write_text('{"schema": "identifiability/other/1"}')
    for verb, text in WRITTEN.items():
        if "--json" not in text:
            continue
        done = command(verb, *text.split(",")[0].split(), "--json", "other.json")
        assert done.exit_code != 0
        assert "holds the result of another verb" in done.stderr, verb


def test_a_setting_that_is_typed_as_an_option_is_refused_with_what_to_type(command):
    for verb, option, setting in [
        ("analyze", "--cutoff", "cutoff=3"),
        ("excite", "--periods", "periods=3"),
    ]:
        for typed in ([option, "3"], [f"{option}=3"]):
            done = command(verb, "two-link", "run.csv", *typed)
            assert done.exit_code == 2
            assert f"{option} is a setting: type --set {setting}." in done.stderr


def test_the_library_and_a_robot_are_loaded_without_what_they_do_not_use(process):
    code = (
        "import sys, identifiability as library\n"
        f"print(*({set(LARGE) | {'numpy'}} & set(sys.modules)))\n"
        "from identifiability import Log, Regression, estimate, gather_information, prepare_log\n"
        f"print(*({set(LARGE)} & set(sys.modules)))\n"
        "library.inspect('two-link')\n"
        "print(*({'scipy.stats', 'scipy.optimize', 'cvxpy', 'matplotlib'} & set(sys.modules)))"
    )
    done = process([sys.executable, "-c", code], check=True)
    assert done.stdout == "\n\n\n"
