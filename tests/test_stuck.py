"""Torque and rows that stand still while the robot moves are no data, and that is said."""

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, analyze
from identifiability.quality.mends import drop_stuck


@pytest.fixture
def frame(simulated):
    return simulated("two-link", "a", samples=600).to_frame()


def mended(frame):
    log, hints = drop_stuck(Log.from_frame(frame, "a.csv"))
    return log, tuple(hints)


def test_torque_of_one_value_is_no_data_and_is_said_first(frame):
    frame["elbow.tau"] = 3.0
    log, hints = mended(frame)
    assert log.unmeasured[:, 1].all()
    assert not log.unmeasured[:, 0].any()
    assert "'elbow.tau' = 3 in every row, while the robot moves" in hints[0]
    hints = analyze("two-link", frame).hints
    assert "'elbow.tau' = 3" in hints[0]
    assert "wrong sign" not in " ".join(hints)


def test_rows_that_repeat_from_the_midst_of_a_motion_on_are_left_out(frame):
    columns = frame.columns.drop("t")
    frame.loc[300:, columns] = frame.loc[300, columns].to_numpy()
    log, (hint,) = mended(frame)
    assert len(log) == 301
    assert "the logger hung, and these 299 of 600 rows are left out" in hint


def test_a_position_that_keeps_its_value_while_the_joint_moves_on_is_left_out(frame):
    """With sixty rows of it an analysis of six axes was useless, and nothing was said."""
    frame.loc[300:360, "elbow.q"] = frame.loc[300, "elbow.q"]
    _, (hint,) = mended(frame)
    assert "elbow.q keeps one value in data rows 302–361" in hint


def test_a_rest_at_the_end_of_the_only_log_verifies_nothing(frame):
    """The held-out quarter was the rest: an error of 72 %, and nothing was identifiable."""
    moving = frame.filter(regex=r"\.(q|tau)$")
    rest = moving.iloc[[-1] * 600]
    rest[["shoulder.tau", "elbow.tau"]] += np.random.default_rng(0).normal(0.0, 0.02, (600, 2))
    log = pd.concat([moving, rest]).assign(t=frame.t[1] * np.arange(1200))
    assert analyze("two-link", log, replicates=0).chosen.error_ra_validation < 0.2


def test_torque_that_stops_changing_is_no_data_from_there_on(frame):
    frame.loc[300:, "elbow.tau"] = 0.5 * (frame["elbow.tau"].min() + frame["elbow.tau"].max())
    log, (hint,) = mended(frame)
    assert log.unmeasured[:, 1].tolist() == [False] * 300 + [True] * 300
    assert "data rows 301–600" in hint


def test_a_motor_at_its_limit_a_rest_and_a_slow_logger_are_data(frame):
    limited = frame.assign(**{"elbow.tau": frame["elbow.tau"].clip(upper=0.0)})
    assert mended(limited)[1] == ()
    held = frame.iloc[np.arange(600) // 20 * 20].reset_index(drop=True).assign(t=frame["t"])
    assert mended(held)[1] == ()
    smooth = np.clip(np.arange(600) / 300, 0, 1)
    rest = {c: frame[c].iloc[0] + smooth**2 * (1 - smooth) ** 2 for c in frame if c != "t"}
    assert mended(frame.assign(**rest))[1] == ()
    frame.loc[300:310, "elbow.q"] = frame.loc[300, "elbow.q"]  # too short to be hung
    assert mended(frame)[1] == ()


@pytest.mark.parametrize("factor", [1e-18, 1e-100, 1e-300])
def test_torque_that_no_robot_has_is_refused(frame, factor, rejected):
    tau = [c for c in frame if c.endswith(".tau")]
    frame[tau] *= factor
    with rejected(r"the largest torque in it is .*, as no robot's is"):
        analyze("two-link", frame)
