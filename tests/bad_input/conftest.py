"""Shared by the tests of bad input: good files to spoil, and commands that must refuse them."""

from pathlib import Path

import pytest

from identifiability import Noise, Robot
from identifiability.logs.conventions import Conventions

from ..conftest import simulated_log


def known(**options):
    return Conventions.of(Robot.load("two-link", **options))


@pytest.fixture(name="known")
def known_of_two_link():
    return known()


@pytest.fixture
def simulated():
    """A function (robot, samples, noise level) -> DataFrame of its own."""

    def frame(name, samples=200, **noise):
        motion = "601" if name == "3-rps" else "a"
        return simulated_log(name, motion, 0, Noise(**noise), samples).to_frame()

    return frame


@pytest.fixture
def arm(simulated):
    """A log of the two-link arm, to be spoilt."""
    return simulated("two-link")


@pytest.fixture
def bare(arm):
    """The same without velocities and accelerations."""
    return arm[["t", "shoulder.q", "elbow.q", "shoulder.tau", "elbow.tau"]]


@pytest.fixture
def write(tmp_path):
    """A function (name, text or bytes or DataFrame) -> path of a file of this test."""

    def put(name, content):
        path = tmp_path / name
        if isinstance(content, str):
            content = content.encode()
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            content.to_csv(path, index=False)
        return path

    return put


def files_in(folder):
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def refused(command, tmp_path):
    """A function (words) -> the sentence; the command fails and leaves every file as it was."""

    def run(*words):
        before = files_in(tmp_path)
        out = command(*words)
        assert out.exit_code == 2, (out.output, out.exception)
        assert isinstance(out.exception, SystemExit)
        assert out.stdout == ""
        lines = out.stderr.strip().split("\n")
        assert len(lines) == 1, lines
        assert lines[0].startswith("Error: ")
        assert lines[0].endswith((".", "?"))
        assert ".." not in lines[0].replace("../", "")
        assert files_in(tmp_path) == before
        return lines[0].removeprefix("Error: ")

    return run


#: An earlier result, which alone may be written over.
OLD = '{"schema": "identifiability/analysis/1"}'


@pytest.fixture
def refuses(refused, write):
    """A function (robot, log, options) -> the sentence with which `analyze` refuses them.

    The output that is asked for exists already, so that an early write would be seen.
    """

    def run(robot, log, *options):
        log = log if isinstance(log, str | Path) else write("log.csv", log)
        return refused("analyze", robot, log, "--json", write("old.json", OLD), *options)

    return run
