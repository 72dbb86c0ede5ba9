"""Copies of rows are no new evidence, however they come; repetitions are."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, analyze
from identifiability.foundation.errors import LogError
from identifiability.logs.logfile import LogFile
from identifiability.logs.repeats import drop_repeats
from identifiability.simulation import Noise


@pytest.fixture(scope="module")
def log(simulated_session):
    return simulated_session("two-link", "a", 0, Noise(torque=0.02))


@pytest.fixture(scope="module")
def again(simulated_session):
    """The same motion measured again, with noise of its own."""
    return replace(simulated_session("two-link", "a", 1, Noise(torque=0.02)), name="again")


def tiled(log, times):
    """The rows of a log several times, one after the other."""
    frame = pd.concat([log.to_frame()] * times, ignore_index=True)
    frame["t"] = np.arange(len(frame)) * (log.t[1] - log.t[0])
    return Log.from_frame(frame, "tiled")


def shaken(log, size, seed=0):
    rng = np.random.default_rng(seed)
    frame = log.to_frame()
    frame.iloc[:, 1:] += size * rng.standard_normal((len(frame), frame.shape[1] - 1))
    return Log.from_frame(frame, "shaken")


def test_rows_given_twenty_times_count_once(log):
    once = analyze("two-link", log, replicates=50)
    many = analyze("two-link", tiled(log, 20), replicates=50)
    assert many.information.samples == once.information.samples
    for a, b in zip(once.full.verdicts, many.full.verdicts, strict=True):
        assert a.sigma_robust == pytest.approx(b.sigma_robust, rel=1e-6)
        assert a.verdict == b.verdict
    assert once.hints == ()
    (hint,) = many.hints
    assert f"({19 * len(log)} of {20 * len(log)})" in hint
    assert "they count once; give each measurement once" in hint
    assert hint in many.statement


@pytest.mark.parametrize("copy", [lambda log: shaken(log, 1e-9), lambda log: shaken(log, 1e-7),
                                  lambda log: log.cut(100, 700, "cut")],
                         ids=["1e-9", "1e-7", "cut"])  # fmt: skip
def test_a_nearly_identical_log_counts_once_wherever_it_is_given(log, copy):
    kept, _, hints = drop_repeats([log, copy(log)])
    assert kept == [log]
    assert len(hints) == 1


def test_a_copy_does_not_validate(log):
    with pytest.raises(LogError, match=r"validation log shaken repeats rows.*give another log"):
        analyze("two-link", log, shaken(log, 1e-9), replicates=0)


def test_what_is_new_in_a_log_is_kept(log, again):
    frame = pd.concat([log.to_frame()[:300], again.to_frame()[300:]], ignore_index=True)
    kept, _, _ = drop_repeats([log, Log.from_frame(frame, "half")])
    assert [len(k) for k in kept] == [len(log), len(log) - 300]
    np.testing.assert_array_equal(kept[1].tau, again.tau[300:])


def test_measurements_of_the_same_motion_are_no_copies(log, again):
    kept, _, hints = drop_repeats([log, again])
    assert kept == [log, again]
    assert hints == ()


def test_standing_still_and_coarse_encoders_are_no_copies():
    """Single rows agree by chance, and a standstill agrees with itself."""
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(4000)
    q = np.round(np.clip(np.sin(0.5 * t), -0.6, 0.6)[:, None], 2)
    tau = np.round(q + 0.05 * rng.standard_normal((4000, 1)), 1)
    log = Log("coarse", ("a",), t, q, tau, None, None, "")
    kept, _, hints = drop_repeats([log])
    assert kept == [log]
    assert hints == ()


def test_a_file_that_is_too_long_for_memory_is_compared_too(log, tmp_path):
    for name, like in (("one.csv", log), ("two.csv", shaken(log, 1e-9))):
        like.to_frame().to_csv(tmp_path / name, index=False)
    one, two = (LogFile.read(tmp_path / name) for name in ("one.csv", "two.csv"))
    kept, _, hints = drop_repeats([one, two])
    assert kept == [one]
    assert "two.csv repeats" in hints[0]


def measured(*, periods=6, noise, step=0.0, most=np.inf, scale=1.0, shift=0.0):
    """A periodic motion of two joints, each period measured by itself."""
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(500)
    q = np.stack([np.sin(1.2566 * t), np.cos(3.7699 * t)], 1)
    tau = np.tile(np.stack([np.cos(1.2566 * t), 0.3 * np.sin(2.5133 * t)], 1), (periods, 1))
    tau = tau + noise * rng.standard_normal(tau.shape)
    tau = np.clip(step * np.round(tau / step) if step else tau, -most, most)
    t = 0.01 * np.arange(len(tau))
    return Log("m", ("a", "b"), t, shift + np.tile(q, (periods, 1)), scale * tau, None, None, "")


@pytest.mark.parametrize("noise", [0.001, 0.01, 0.05])
@pytest.mark.parametrize(
    "limits", [{"step": 0.1}, {"step": 0.3}, {"most": 0.1}, {"most": 0.2, "step": 0.05}], ids=str
)
def test_torque_that_saturates_or_has_few_steps_is_no_copy(noise, limits):
    log = measured(noise=noise, **limits)
    assert drop_repeats([log]) == ([log], [], ())
