"""Long commands: the same result on every engine, taken up again, and ended by Ctrl-C at once."""

import json
import os
import signal
import sys
import time

import pytest
from typer.testing import CliRunner

from identifiability.cli import app
from identifiability.foundation.engines import Processes


@pytest.fixture(scope="module")
def two():
    with Processes(2) as engine:
        yield engine


@pytest.fixture(scope="module")
def log(simulated_session):
    return simulated_session("two-link", "a", 0, samples=300)


def test_a_calibration_is_taken_up_again(log, tmp_path):
    path = log.write(tmp_path / "log.csv")
    words = ["calibrate", "two-link", str(path), "--quick", "--set", "engine=serial"]
    words += ["--names", "0", "--replicates", "4", "--set", f"resume={tmp_path / 'work'}", "--json"]
    first, again = tmp_path / "first.json", tmp_path / "again.json"
    run = CliRunner().invoke(app, [*words, str(first)])
    assert run.exit_code == 0, run.output
    assert "posterior" not in run.output  # without simulation-based calibration nothing is said
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "work").rglob("*.result")}
    assert len(kept) == 4
    victim = min(kept)
    victim.unlink()
    assert CliRunner().invoke(app, [*words, str(again)]).exit_code == 0
    assert json.loads(first.read_text()) == json.loads(again.read_text())
    now = {p: p.stat().st_mtime_ns for p in (tmp_path / "work").rglob("*.result")}
    assert now.keys() == kept.keys()
    assert {p for p in now if now[p] != kept[p]} == {victim}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--set", "engine=serial", "--set", "scheduler=tcp://a:1"], "give the engine 'dask'"),
        (["--set", "resume={log}"], "give a folder"),
    ],
)
def test_engines_that_cannot_be_are_one_sentence(words, sentence, log, tmp_path):
    path = str(log.write(tmp_path / "log.csv"))
    words = [word.format(log=path) for word in words]
    run = CliRunner().invoke(app, ["prune", "two-link", path, *words])
    assert run.exit_code == 2
    assert sentence in " ".join(run.stderr.split())


@pytest.mark.skipif(sys.platform == "win32", reason="there are no process groups")
@pytest.mark.everything  # the signals themselves: test_ends_well
def test_ctrl_c_ends_a_calibration_and_its_workers_at_once(log, spawn, group, tmp_path):
    report, result, work = (tmp_path / name for name in ("r.html", "r.json", "work"))
    for path in (report, result):
        path.write_text("old")
    running = spawn(
        "-m", "identifiability", "calibrate", "two-link", log.write(tmp_path / "log.csv"),
        "--replicates", 60, "--quick", "--names", 0,
        "--set", "workers=2", "--set", f"resume={work}",
        "--report", report, "--json", result,
    )  # fmt: skip
    until = time.monotonic() + 1200
    while not list(work.rglob("*.result")) and time.monotonic() < until:
        time.sleep(0.05)
    assert len(group(running.pid)) > 2  # the command and its workers
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does
    stdout, stderr = running.communicate(timeout=600)
    assert running.returncode == 130
    assert stderr.strip() == "Stopped; no file was left half-written."
    assert stdout == ""
    until = time.monotonic() + 60
    while group(running.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert group(running.pid) == []
    assert report.read_text() == result.read_text() == "old"
    assert not list(tmp_path.rglob(".*.tmp"))
