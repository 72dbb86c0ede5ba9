"""Whatever kind of file is written: a full disk or Ctrl-C leaves the old one as it was."""

import errno
import os

import pytest

from identifiability import analyze
from identifiability.errors import OutputError
from identifiability.log import Log
from identifiability.pruning import prune
from identifiability.robot import Robot
from identifiability.robot.write import write_robot

FULL = OSError(errno.ENOSPC, "No space left on device")
KINDS = ("json", "html", "csv", "parquet", "xml", "urdf", "sidecar", "model")


@pytest.fixture(scope="module")
def results(simulated_session):
    log = simulated_session("two-link", "a", samples=200)
    return {"log": log, "analysis": analyze("two-link", log, replicates=0),
            "ladder": prune("two-link", log, replicates=2)}  # fmt: skip


@pytest.fixture
def written(results, tmp_path):
    """A function (kind) -> a function that writes such a file, and the file."""

    def build(kind):
        arm = Robot.load("six-dof-arm" if kind in ("urdf", "sidecar") else "two-link")
        robot = tmp_path / ("out.xml" if kind == "xml" else "out.urdf")
        parameters = arm.nominal | ({f"{arm.axes[0].name}.Fc": 0.7} if kind == "sidecar" else {})
        ways = {
            "json": ("out.json", results["analysis"].to_json),
            "html": ("out.html", results["analysis"].write_report),
            "csv": ("out.csv", results["log"].write),
            "parquet": ("out.parquet", results["log"].write),
            "xml": ("out.xml", lambda _: write_robot(arm, parameters, robot)),
            "urdf": ("out.urdf", lambda _: write_robot(arm, parameters, robot)),
            "sidecar": ("out.toml", lambda _: write_robot(arm, parameters, robot)),
            "model": ("out.toml", results["ladder"].write_model),
        }
        name, write = ways[kind]
        path = tmp_path / name
        return path, lambda: write(path)

    return build


@pytest.mark.parametrize("stop", [FULL, KeyboardInterrupt()], ids=["full disk", "ctrl-c"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_stopped_write_leaves_the_old_file_and_nothing_else(kind, stop, written, monkeypatch):
    path, write = written(kind)
    write()
    if kind == "parquet":
        assert len(Log.read(path)) == 200
    path.write_bytes(b"old")
    beside = {p.name for p in path.parent.iterdir()}
    # A sidecar is written after its robot file.
    sync, calls = os.fsync, []

    def fail(stream):
        calls.append(stream)
        if kind != "sidecar" or len(calls) > 1:
            raise stop
        sync(stream)

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OutputError if stop is FULL else KeyboardInterrupt):
        write()
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert {p.name for p in path.parent.iterdir()} == beside
