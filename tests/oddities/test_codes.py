"""Integers that are codes of signed numbers are decoded when a log is read, and that is said."""

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from identifiability import Log
from identifiability.quality.recordings import read_recordings

BITS = (8, 11, 12, 16, 24, 32)


def two_complement(counts, bits):
    return counts % 2**bits


def sign_bit(counts, bits):
    return np.abs(counts) + 2 ** (bits - 1) * (counts < 0)


def counted(bits, seed=0):
    """Return a log in counts: torque and positions that cross zero, with noise."""
    rng = default_rng(seed)
    t = np.arange(0.0, 4.0, 0.01)
    most = 2 ** (bits - 1) - 1
    values = {"t": t}
    for k, joint in enumerate(("shoulder", "elbow")):
        swing = np.sin(2 * np.pi * (0.5 + 0.3 * k) * t + k)
        values[f"{joint}.q"] = np.rint(0.6 * most * swing)
        noisy = 0.7 * swing + 0.01 * rng.standard_normal(len(t))
        values[f"{joint}.tau"] = np.rint(most * noisy)
    return pd.DataFrame(values)


def encoded(log, code, bits, kind):
    columns = [name for name in log if name.endswith(f".{kind}")]
    return log.assign(**{name: code(log[name].astype(int), bits) for name in columns})


@pytest.mark.parametrize("kind", ["q", "tau"])
@pytest.mark.parametrize("code", [two_complement, sign_bit])
@pytest.mark.parametrize("bits", BITS)
def test_a_code_is_read_as_the_signed_numbers_that_it_stands_for(bits, code, kind):
    log = counted(bits)
    read = Log.from_frame(encoded(log, code, bits, kind))
    names = [f"{joint}.{kind}" for joint in read.joints]
    assert_array_equal(getattr(read, kind), log[names])
    word = "sign in bit" if code is sign_bit else "two's complement"
    assert any(word in note for note in read.notes)


def test_torque_that_is_always_negative_is_known_by_its_kind_or_the_end_of_its_register():
    log = counted(16)
    most = np.abs(log["elbow.tau"])
    for elbow, share in ((np.maximum(-3000.0 - most, -32768.0), 1), (-500.0 - most // 8, 8)):
        given = log.assign(**{"elbow.tau": elbow, "shoulder.tau": log["shoulder.tau"] // share})
        read = Log.from_frame(encoded(given, two_complement, 16, "tau"))
        assert_array_equal(read.tau, given[["shoulder.tau", "elbow.tau"]])


def test_a_joint_that_passes_zero_ticks_leaves_ticks_of_other_joints_as_they_are():
    """Servos count 0 … 4095 in a turn: one joint passes 0, commands of the other the middle."""
    log = counted(12)
    log["elbow.q"] = 2050 + np.abs(log["elbow.q"])
    for joint in ("shoulder", "elbow"):
        log[f"{joint}.cmd"] = log[f"{joint}.q"] - 10
    wrapped = {name: log[name] % 4096 for name in ("shoulder.q", "shoulder.cmd")}
    read = Log.from_frame(log.assign(**wrapped))
    assert_array_equal(read.q, log[["shoulder.q", "elbow.q"]])
    assert_array_equal(read.q_ref, log[["shoulder.cmd", "elbow.cmd"]])


@pytest.mark.parametrize("bits", BITS)
def test_numbers_that_are_no_codes_stay_as_they_are(bits):
    log = counted(bits)
    half = 2.0 ** (bits - 1)
    unsigned = log.assign(**{"shoulder.tau": log["shoulder.tau"] + half})  # an offset of a counter
    coarse = log.assign(**{"elbow.tau": default_rng(1).integers(0, 8, len(log))})
    for frame in (log, unsigned, coarse, log / 7.0, log.abs()):
        read = Log.from_frame(frame)
        assert_array_equal(read.tau, frame[["shoulder.tau", "elbow.tau"]])
        assert not any("numbers" in note for note in read.notes)


@pytest.mark.parametrize("code, fitted", [(two_complement, 2), (sign_bit, 2), (sign_bit, 1)])
def test_a_log_that_shows_no_code_is_read_by_the_code_of_the_logs_before(code, fitted):
    shows = encoded(counted(11), code, 11, "tau")
    silent = counted(11, seed=1)
    torque = ["shoulder.tau", "elbow.tau"]
    silent[torque] = -100.0 - np.abs(silent[torque]) // 2
    logs = [shows, encoded(silent, code, 11, "tau")]
    recordings = read_recordings(logs[:fitted], logs[fitted:])
    read = (*recordings.fitted, *recordings.held_out)[1]
    assert_array_equal(read.tau, silent[torque])


def test_a_code_that_only_a_held_out_log_shows_does_not_change_the_fitted_logs():
    silent = counted(11, seed=1)
    silent["elbow.tau"] = -100.0 - np.abs(silent["elbow.tau"]) // 2
    silent["shoulder.tau"] = np.abs(silent["shoulder.tau"])
    silent = encoded(silent, sign_bit, 11, "tau")
    recordings = read_recordings(silent, encoded(counted(11), sign_bit, 11, "tau"))
    assert_array_equal(recordings.fitted[0].tau, silent[["shoulder.tau", "elbow.tau"]])
