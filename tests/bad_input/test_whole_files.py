"""Whatever kind of file is written: a full disk or Ctrl-C leaves the old one as it was."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from identifiability import IdentifiabilityError, Log, Robot, analyze, inspect, prune
from identifiability.simulation import PrescribedMotion
from identifiability.simulation.motion import write_trajectory_bag
from identifiability.workflows.export import write_parameters


def files_in(folder):
    return {p: p.read_bytes() for p in folder.rglob("*") if not p.is_dir()}


FULL = OSError(errno.ENOSPC, "No space left on device")
STOPS = pytest.mark.parametrize("stop", [FULL, KeyboardInterrupt()], ids=["full disk", "ctrl-c"])
KINDS = ("json", "html", "csv", "parquet", "xml", "urdf", "sidecar", "model")
MORE = ("twin", "motion bag")


@pytest.fixture(scope="module")
def results(simulated_session):
    log = simulated_session("two-link", "a", samples=200)
    return {"log": log, "analysis": analyze("two-link", log, replicates=0),
            "ladder": prune("two-link", log, replicates=2),
            "inspection": inspect("two-link")}  # fmt: skip


@pytest.fixture
def written(results, tmp_path):
    """A function (kind) -> a function that writes such a file, and the file."""

    def build(kind):
        if kind == "motion bag":
            pytest.importorskip("rosbags", reason="needs the extra 'ros'")
        arm = Robot.load("six-dof-arm" if kind in ("urdf", "sidecar") else "two-link")
        robot = tmp_path / ("out.xml" if kind == "xml" else "out.urdf")
        six = Robot.load("six-dof-arm")
        motion = PrescribedMotion(np.arange(9.0), *np.ones((3, 9, 1)))
        parameters = arm.nominal | ({f"{arm.axes[0].name}.Fc": 0.7} if kind == "sidecar" else {})
        ways = {
            "json": ("out.json", results["analysis"].to_json),
            "html": ("out.html", results["inspection"].write_report),
            "csv": ("out.csv", results["log"].write),
            "parquet": ("out.parquet", results["log"].write),
            "xml": ("out.xml", lambda _: write_parameters(arm, parameters, robot)),
            "urdf": ("out.urdf", lambda _: write_parameters(arm, parameters, robot)),
            "sidecar": ("out.toml", lambda _: write_parameters(arm, parameters, robot)),
            "model": ("out.toml", results["ladder"].write_model),
            "twin": ("out.xml", lambda path: write_parameters(six, six.nominal, path)),
            "motion bag": ("out.mcap", lambda path: write_trajectory_bag(path, ["j"], motion)),
        }
        name, write = ways[kind]
        path = tmp_path / name
        return path, lambda: write(path)

    return build


@STOPS
@pytest.mark.parametrize("kind", [*KINDS, *MORE])
def test_a_stopped_write_leaves_the_old_file_and_nothing_else(kind, stop, written, monkeypatch):
    path, write = written(kind)
    write()
    if kind == "parquet":
        assert len(Log.read(path)) == 200
    old = b'name = "old"' if kind == "sidecar" else b"old"  # only sidecars are written over
    path.write_bytes(old)
    beside = {p.name for p in path.parent.iterdir()}
    # A sidecar is written after its robot file.
    sync = os.fsync
    calls = []

    def fail(stream):
        calls.append(stream)
        if kind != "sidecar" or len(calls) > 1:
            raise stop
        sync(stream)

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(IdentifiabilityError if stop is FULL else KeyboardInterrupt):
        write()
    monkeypatch.undo()
    assert path.read_bytes() == old
    assert {p.name for p in path.parent.iterdir()} == beside


def stop_at(monkeypatch, count, stop):
    """Let the count-th renaming of a file fail, and those that undo it succeed."""
    replace = Path.replace
    calls = []

    def fail(self, target):
        calls.append(target)
        if len(calls) == count:
            raise stop
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", fail)


@STOPS
@pytest.mark.parametrize("count", [1, 2])
def test_a_robot_and_its_sidecar_are_written_both_or_none(count, stop, tmp_path, monkeypatch):
    rps = Robot.load("3-rps")
    path = tmp_path / "copy.xml"
    write_parameters(rps, {"slider1.Fc+": 300.0, "slider1.Fc-": 200.0}, path)
    before = files_in(tmp_path)
    stop_at(monkeypatch, count, stop)
    with pytest.raises(IdentifiabilityError if stop is FULL else KeyboardInterrupt):
        write_parameters(
            rps, {"slider1.Fc+": 500.0, "slider1.Fc-": 400.0, "platform.m": 11.0}, path
        )
    monkeypatch.undo()
    assert files_in(tmp_path) == before
    assert len(before) == 2


def test_a_sidecar_takes_no_other_files_name(tmp_path, rejected, two_link):
    rps = Robot.load("3-rps")
    path = tmp_path / "copy.xml"
    beside = tmp_path / "copy.toml"
    beside.write_text("[[models]]\n")
    with rejected(r"copy.toml' is no sidecar, but has the name"):
        write_parameters(rps, {}, path)
    assert list(files_in(tmp_path)) == [beside]
    beside.write_text("name = 'other'")
    bare = tmp_path / "bare.xml"
    bare.write_bytes(two_link.path.read_bytes())
    with rejected(r"would be read as the sidecar of .*copy.xml'; give"):
        write_parameters(Robot.load(bare), {}, path)
    own = tmp_path / "own.xml"
    own.write_bytes(bare.read_bytes())
    own.with_suffix(".toml").write_text("name = 'own'")
    twin = write_parameters(Robot.load(own), {}, tmp_path / "own.mjcf")
    assert twin.sidecar == tmp_path / "own.mjcf.toml"
    assert own.with_suffix(".toml").read_text() == "name = 'own'"


def test_two_robot_files_that_need_other_sidecars_have_one_each(tmp_path):
    """A URDF has its rotors there, and its MJCF does not: either would spoil the other."""
    arm = Robot.load("six-dof-arm")
    rotor = {f"{arm.joints[0]}.Ia": 0.3}
    first = write_parameters(arm, rotor, tmp_path / "fitted.urdf").sidecar
    before = {path: path.read_bytes() for path in files_in(tmp_path)}
    for _ in range(2):  # and again
        write_parameters(arm, rotor, tmp_path / "fitted.xml")
        own = tmp_path / "fitted.xml.toml"
        assert {path: path.read_bytes() for path in before} == before
        assert Robot.load(tmp_path / "fitted.xml").sidecar == own
        assert Robot.load(tmp_path / "fitted.xml").nominal[f"{arm.joints[0]}.Ia"] == 0.3
        assert Robot.load(tmp_path / "fitted.urdf").sidecar == first
        write_parameters(arm, rotor, tmp_path / "fitted.urdf")
