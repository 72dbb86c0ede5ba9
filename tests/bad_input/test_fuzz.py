"""A short run of `fuzz.py`: spoilt files of every kind, in a process of its own."""

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

EXAMPLES = 24


def test_spoilt_files_give_our_sentences_and_neither_crash_nor_hang():
    words = [sys.executable, Path(__file__).with_name("fuzz.py"), "--examples", str(EXAMPLES)]
    out = subprocess.run(words, check=False, capture_output=True, text=True, timeout=1200)
    assert out.returncode == 0, out.stdout[-500:] + out.stderr[-4000:]
    tallies = {t["reader"]: t for t in map(json.loads, out.stdout.splitlines()[1:])}
    readers = {"csv", "parquet", "npz", "mat", "ladder", "sidecar", "trajectories", "mjcf", "urdf"}
    readers |= {"result"} | ({"bag"} if find_spec("rosbags") else set())
    assert set(tallies) == readers
    for tally in tallies.values():
        assert tally["inputs"] == tally["accepted"] + tally["refused"] == EXAMPLES
        assert tally["refused"] > EXAMPLES / 2  # the files were spoilt indeed
        assert tally["reasons"] > 2
    assert out.stderr == ""
