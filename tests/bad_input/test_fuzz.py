"""A short run of `fuzz.py`: spoilt files of every kind, in a process of its own."""

import sys
from pathlib import Path


def test_spoilt_files_give_our_sentences_and_neither_crash_nor_hang(process):
    words = [sys.executable, Path(__file__).with_name("fuzz.py"), "24"]
    out = process(words, timeout=1200)
    assert out.returncode == 0, out.stdout[-500:] + out.stderr[-4000:]
    counts = {
        name: int(refused) for name, _, refused in map(str.split, out.stdout.splitlines()[1:])
    }
    kinds = ("csv", "parquet", "npz", "mat", "ladder", "sidecar", "trajectories", "mjcf", "urdf")
    assert counts.keys() >= {*kinds}
    assert all(counts[kind] > 0 for kind in kinds)
