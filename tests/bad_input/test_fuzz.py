"""A short run of `fuzz.py`: spoilt files of every kind, in a process of its own."""

import importlib
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = 24


@pytest.fixture
def study(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "studies"))
    return importlib.import_module("fuzz_readers")


def test_spoilt_files_give_our_sentences_and_neither_crash_nor_hang(study):
    words = [sys.executable, Path(__file__).with_name("fuzz.py"), "--examples", str(EXAMPLES)]
    out = subprocess.run(words, check=False, capture_output=True, text=True, timeout=1200)
    assert out.returncode == 0, out.stdout[-500:] + out.stderr[-4000:]
    tallies = {t["reader"]: t for t in map(json.loads, out.stdout.splitlines()[1:])}
    readers = {"csv", "parquet", "npz", "mat", "ladder", "sidecar", "trajectories", "mjcf", "urdf"}
    readers |= {"result"} | ({"bag"} if find_spec("rosbags") else set())
    assert set(tallies) == readers <= set(study.FILES)
    for tally in tallies.values():
        assert tally["inputs"] == tally["accepted"] + tally["refused"] == EXAMPLES
        assert tally["refused"] > EXAMPLES / 2  # the files were spoilt indeed
        assert tally["reasons"] > 2
    assert out.stderr == ""


def test_the_study_counts_a_crash_and_goes_on(study, monkeypatch, tmp_path):
    """One fuzzer that dies like a parser in C++, one that counts."""
    fake = tmp_path / "fuzz.py"
    tally = {"reader": "csv", "inputs": 14, "distinct": 10, "accepted": 2, "refused": 12}
    tally |= {"other": 0, "reasons": 5, "slowest": 0.01, "longest": 2, "longest_sentence": "A."}
    fake.write_text(
        "import json, os, sys\nprint('/folder', flush=True)\n"
        f"if 'mjcf' in sys.argv: os.abort()\nprint({json.dumps(json.dumps(tally))})\n"
    )
    monkeypatch.setattr(study, "FUZZER", fake)
    rows = [study.measure("csv", 14), study.measure("mjcf", 14)]
    assert [study.good(r) for r in rows] == [True, False]
    assert study.state(rows).endswith("Something else came of: robot, MJCF.")
    study.write(rows, 14, tmp_path / "fuzz.json")
    page = " ".join((tmp_path / "fuzz.html").read_text().split())
    assert "crash or hang" in page
    assert "no crash and no hang" in study.state(rows[:1])
