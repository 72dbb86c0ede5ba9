"""The command line does what the README says."""

import subprocess
import sys
from types import SimpleNamespace

import pandas as pd

import identifiability
from identifiability.cli import common
from identifiability.foundation.answers import Answer
from identifiability.foundation.findings import Finding
from identifiability.report.answers.common import after_colon


def test_simulated_logs_are_analyzed(succeeds, tmp_path):
    train = tmp_path / "train.csv"
    test = tmp_path / "test.parquet"
    for path, name, seed in ((train, "601", 1), (test, "595", 2)):
        succeeds("simulate", "3-rps", name, "--noise", "paper", "--seed", seed, "--out", path)
    assert len(pd.read_csv(train)) == 750
    out = succeeds("analyze", "3-rps", train, "--validate", test)
    assert "12 of 12 parameters are identifiable" in out.output
    assert "force [N]" in succeeds("inspect", "3-rps", train, "-v").output


#: What each command does without.
NEEDLESS = ["scipy.stats", "scipy.signal", "cvxpy", "joblib", "emcee", "numpy.f2py.f2py2e", "glfw"]
NEEDLESS += [f"identifiability.workflows.{verb}" for verb in ("prune", "diagnose", "excite")]
RUNS = {
    "analyze six-dof-arm run.csv": [*NEEDLESS, "matplotlib", "mujoco"],
    "analyze six-dof-arm run.csv --report report.html": NEEDLESS,
    "simulate two-link random --out moved.csv": NEEDLESS,
}


def test_commands_import_no_large_module_that_they_do_not_use(command, tmp_path):
    log = tmp_path / "run.csv"
    command("simulate", "six-dof-arm", "random", "--samples", 600, "--out", log)
    # Positions alone pass the low-pass and are differentiated.
    pd.read_csv(log).filter(regex=r"(t|\.q|\.tau)$").to_csv(log, index=False)
    code = (
        "import sys; from robot_identifiability import main\n"
        f"for words, needless in {RUNS}.items():\n"
        "  sys.argv = ['x', *words.split()]\n"
        "  try: main()\n"
        "  except SystemExit as end: assert not end.code\n"
        "  assert not {*needless} & {*sys.modules}, sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)


def test_a_pipe_gets_the_time_that_all_takes_every_half_minute(monkeypatch, capsys):
    times = iter([0, 20, 30, 60])
    monkeypatch.setattr(common, "monotonic", lambda: next(times))
    with common.progress() as say:
        for share in (0.2, 0.3, 0.5):
            say("reading", share)
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"reading (all: about {left} s more)" for left in (80, 60)]


def test_the_version_is_printed(succeeds):
    said = succeeds("--version").output
    assert said == f"identifiability {identifiability.__version__}\n"


def test_a_note_that_leads_an_answer_is_printed_once(capsys):
    notes = [Finding("alternative", text=f"The clock of {name} is late.") for name in "AB"]
    led = Answer("May I trust it?", f"With care: {after_colon(notes[0])}.")
    none = dict.fromkeys(("tables", "ledger", "next"), list)
    result = SimpleNamespace(answers=lambda: [led], warnings=(), remarks=notes, **none)
    common.print_result(result)
    printed = capsys.readouterr()
    assert [(printed.out + printed.err).count(f"clock of {name}") for name in "AB"] == [1, 1]
