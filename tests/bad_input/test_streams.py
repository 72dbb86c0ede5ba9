"""A command without a terminal, or with a full one, does its work or says one sentence."""

import subprocess
import sys

import pytest

HELP = f"{sys.executable} -m identifiability --help"
MISSING = f"{sys.executable} -m identifiability analyze two-link nothing.csv"
SIMULATE = f"{sys.executable} -m identifiability simulate two-link random --out log.csv"


def run(command, folder):
    words = ["sh", "-c", command]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)


def test_a_job_without_streams_writes_its_result(tmp_path):
    assert run(f"{SIMULATE} 2>&- >&-", tmp_path).returncode == 0
    assert (tmp_path / "log.csv").stat().st_size > 10_000


@pytest.mark.parametrize("command, code", [(HELP, 0), (MISSING, 2)])
def test_a_closed_stream_changes_no_exit_code(command, code, tmp_path):
    assert run(f"{command} 2>&-", tmp_path).returncode == code


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="there is no /dev/full")
def test_a_full_output_is_one_sentence(tmp_path):
    done = run(f"{HELP} > /dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr == "Error: the output cannot be written: No space left on device.\n"
    assert run(f"{MISSING} 2> /dev/full", tmp_path).returncode == 2
