"""Degrees are read where it is said, refused where it must be said; rad is taken at its word."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log, Robot, prepare_log
from identifiability.logs.conventions import Conventions

DEGREES = 180 / np.pi


@pytest.fixture
def degrees(simulated, tmp_path):
    """A log of the arm in degrees, and the same in rad."""
    log = simulated("six-dof-arm", "a")
    path = replace(log, **{c: DEGREES * getattr(log, c) for c in ("q", "dq", "ddq")}).write(
        tmp_path / "degrees.csv"
    )
    return path, log


@pytest.mark.parametrize("how", ["option", "sidecar"])
def test_degrees_are_read_where_it_is_said(degrees, how, tmp_path):
    path, log = degrees
    robot = Robot.load("six-dof-arm", angles="deg")
    if how == "sidecar":
        shipped = Robot.load("six-dof-arm")
        own = tmp_path / "own.toml"
        own.write_text('angles = "deg"\n' + shipped.sidecar.read_text())
        robot = Robot.load("six-dof-arm", own)
    read = Log.read(path, Conventions.of(robot))
    assert "angles were read as degrees" in read.notes
    assert np.allclose(read.rows(0, len(log)).q, log.q, rtol=1e-12)
    assert np.allclose(read.rows(0, len(log)).dq, log.dq, rtol=1e-12)
    assert np.allclose(read.rows(0, len(log)).tau, log.tau, rtol=1e-14, atol=0)


def test_sliding_joints_are_in_metres_whatever_angles_are(noisy_log):
    known = Conventions.of(Robot.load("3-rps", angles="deg"))
    assert np.array_equal(Log.from_frame(noisy_log.to_frame(), conventions=known).q, noisy_log.q)


def test_degrees_must_be_said_and_rad_may_be(degrees, rejected):
    path, _ = degrees
    with rejected(r"it looks like degrees: say .*angles='deg'"):
        prepare_log(Robot.load("six-dof-arm"), Log.read(path))
    assert len(prepare_log(Robot.load("six-dof-arm", angles="rad"), Log.read(path)).tau)
