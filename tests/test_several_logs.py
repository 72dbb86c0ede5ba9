"""The log that disagrees is named, with what differs; one log says what one motion cannot show."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, Noise, analyze, simulate
from identifiability.logs.conventions import Conventions
from identifiability.quality.recordings import read_logs
from identifiability.simulation import PrescribedMotion, random_trajectory


@pytest.fixture(scope="module")
def logs(two_link):
    """Three motions of one robot."""
    rng = np.random.default_rng(3)
    found = []
    for name in ("first", "second", "third"):
        motion = random_trajectory(two_link, rng, samples=1500)
        noise = Noise(torque=0.02)
        log = simulate(two_link, PrescribedMotion.of(motion), noise=noise, rng=rng)
        found.append(replace(log, name=name))
    return found


def rubbed(log):
    """The same log with 0.3 N·m more Coulomb friction in the elbow."""
    frame = log.to_frame()
    frame["elbow.tau"] += 0.3 * np.sign(frame["elbow.dq"])
    return Log.from_frame(frame, log.name)


@pytest.fixture(scope="module")
def mixed(logs):
    three = [logs[0], rubbed(logs[1]), logs[2]]
    return analyze("two-link", three, "none", replicates=50)


def test_the_odd_log_is_named_with_parameter_and_joint(mixed):
    said = "± covers that values differ between first, second and third: elbow.Fc"
    (hint,) = (h for h in mixed.hints if h.startswith(said))
    assert hint in mixed.details
    assert "`compare` finds the change and its log" in hint


def test_the_interval_holds_the_values_of_both(logs, mixed):
    equal = analyze("two-link", logs, "none", replicates=50)
    (before,) = (v for v in equal.chosen.verdicts if v.name.startswith("elbow.Fc"))
    (after,) = (v for v in mixed.chosen.verdicts if v.name.startswith("elbow.Fc"))
    low, high = after.interval95
    assert low < before.value < high
    assert low < before.value + 0.3 < high
    assert after.sigma_robust > 5 * before.sigma_robust


def test_logs_with_one_name_get_numbers():
    """Else the rows of a change in one of them are left out of another."""
    t = np.arange(100) / 100
    frames = [pd.DataFrame({"t": t, "j.q": np.sin(t), "j.tau": size * t}) for size in (1.0, 2.0)]
    logs = read_logs([Log.from_frame(frame) for frame in frames], Conventions())
    assert [log.name for log in logs] == ["log 1", "log 2"]
