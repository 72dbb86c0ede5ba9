"""Skips are listed in one line with their reasons; in CI each is a failure."""

import os
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent

#: A skip of every kind: in a test, by a mark, in a fixture, and of a whole file.
SKIPPING = {
    "test_three.py": """
import pytest

@pytest.fixture
def arm():
    pytest.skip("no data of the arm")

def test_in_a_test():
    pytest.skip("no data of the arm")

def test_in_a_fixture(arm):
    pass

@pytest.mark.skipif(True, reason="needs Chromium")
def test_by_a_mark():
    pass
""",
    "test_file.py": """
import pytest

pytest.importorskip("no_such_package", reason="needs the extra 'ros'")

def test_nothing():
    pass
""",
}


@pytest.fixture(params=[(), ("--numprocesses", "2")])
def run(request, tmp_path, process):
    """A function CI -> exit code and last lines of a run of tests that skip."""
    for name, text in SKIPPING.items():
        (tmp_path / name).write_text(text)

    def outcome(ci):
        words = ["-p", "skips", "-q", "--continue-on-collection-errors", *request.param]
        done = process(
            [sys.executable, "-m", "pytest", *words, "--rootdir", str(tmp_path), str(tmp_path)],
            env=os.environ | {"CI": ci, "PYTHONPATH": str(HERE), "PYTEST_ADDOPTS": ""},
            cwd=tmp_path,
        )
        return done.returncode, done.stdout

    return outcome


def test_all_skips_stand_in_one_line_with_their_reasons(run):
    _, said = run("false")
    lines = [line for line in said.splitlines() if line.startswith("skipped: ")]
    assert len(lines) == 1
    for reason in ("2 × no data of the arm", "1 × needs Chromium", "1 × needs the extra 'ros'"):
        assert reason in lines[0]


def test_every_skip_is_a_failure_in_ci(run):
    code, said = run("true")
    assert code != 0
    for reason in ("no data of the arm", "needs Chromium", "needs the extra 'ros'"):
        assert f"skipped in CI: {reason}" in said
    assert " skipped" not in said.splitlines()[-1]
