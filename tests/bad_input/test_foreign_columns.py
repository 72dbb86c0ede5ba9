"""Logs whose columns have other names, or that tell of more than the robot: read, and said."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    IdentifiabilityError,
    Log,
    Preparation,
    Robot,
    analyze,
    inspect,
    prepare_log,
)
from identifiability.foundation.findings import of_key
from identifiability.logs.conventions import Conventions
from identifiability.quality.recordings import read_recordings

from .conftest import known

MAP = {r"fer_(\w+)": r"\1"}


@pytest.fixture
def foreign(arm):
    """The log of the arm under the names of another driver, with a gripper that has no torque."""
    arm = arm.rename(columns=lambda c: c if c == "t" else f"fer_{c}")
    return arm.assign(**{"finger.q": 0.0, "note": "hot"})


def same(log, arm):
    plain = Log.from_frame(arm).select(("shoulder", "elbow"))
    log = log.select(("shoulder", "elbow"))
    for channel in ("t", "q", "dq", "ddq", "tau"):
        assert_allclose(getattr(log, channel), getattr(plain, channel), rtol=1e-12)


def test_renamed_joints_are_read_short_and_long_alike_and_the_note_says_so(
    foreign, arm, write, read_long
):
    path = write("log.csv", foreign)
    names = known(columns=MAP)
    logs = [Log.read(path, names), Log.from_frame(foreign, "frame", names)]
    file = read_long(path, names)
    for log in (*logs, file.rows(0, len(file))):
        same(log, arm)
        renamed, left = log.notes
        assert renamed.startswith("columns were renamed (fer_shoulder.q is shoulder.q, fer_")
        assert left == "columns of finger, which the robot does not drive, were left out"
    assert read_recordings(path, (), names).hints == (
        f"How log.csv was read: {'; '.join(file.notes)}.",
    )
    again = write("again.csv", foreign.assign(t=foreign["t"] + 1))
    hint, *_ = read_recordings([path, again], (), names).hints
    assert hint.startswith("How log.csv, again.csv were read: ")


def test_the_sidecar_and_the_option_rename_and_the_option_comes_first(
    foreign, write, succeeds, tmp_path
):
    path = write("log.csv", foreign)
    sidecar = write("side.toml", "[columns]\n'fer_(\\w+)' = '\\1'\n")
    read_recordings(path, (), known(sidecar=sidecar))
    run = ["analyze", "two-link", path, "-v", "--quick", "--json", tmp_path / "out.json"]
    out = succeeds(*run, "--map", "fer_shoulder=shoulder", "--map", r"fer_e(\w+)=e\1")
    assert "columns were renamed" in out.output
    first = Robot.load("two-link", sidecar, {"fer_elbow": "wrist"}).columns
    assert [first.apply(n) for n in ("fer_elbow", "fer_shoulder")] == ["wrist", "shoulder"]


def test_currents_under_usual_names_need_gains_and_take_stated_units(bare, write, rejected):
    side = write("side.toml", "[torque]\ngain = {shoulder = 2.0, elbow = 4.0}\n")
    names = ["t", "q1", "q2", "actual_current_1 [mA]", "cur_2 [mA]"]
    # Currents may have the other sign, as long as nothing states their gains.
    given = (bare * [1, 1, 1, -1, -1]).set_axis(names, axis=1)
    seen = inspect("two-link", given)
    assert "1 thing" in seen.statement
    assert seen.warnings[0].startswith("log 1 has currents and no torques of shoulder, elbow")
    assert "and ratio = {shoulder = " in seen.warnings[0]
    assert seen.records[0].clock["samples"] == len(given)
    assert np.isnan(seen.records[0].tau).all()
    assert "gain and ratio" in seen.next()[0][0]
    log = Log.from_frame(given, "log", known(sidecar=side))
    scaled = bare[["shoulder.tau", "elbow.tau"]] * [-2e-3, -4e-3]
    assert_allclose(log.tau, scaled, rtol=1e-12)
    for last, says in (
        ("cur_2 [Nm]", r"is a current, but .* stated as 'Nm'"),
        ("elbow.tau [mA]", r"'elbow\.current \[mA\]' .* \[columns\]"),
    ):
        with rejected(says):
            Log.from_frame(given.set_axis([*names[:4], last], axis=1), "log", known(sidecar=side))
    mapped = Robot.load("two-link", columns={"drive_pct": "elbow.tau"})
    with rejected(r"torque of elbow in percent\. State the"):
        Log.from_frame(bare.rename(columns={"elbow.tau": "drive_pct"}), "", Conventions.of(mapped))


def locked(frame, **elbow):
    """What a log in which the elbow does this says, where the elbow is locked."""
    known = Conventions.of(Robot.load("two-link", lock=["elbow"]))
    return Log.from_frame(frame.assign(**elbow), "log", known).notes


@pytest.mark.parametrize("called", ["elbow.q", "/joint_states/elbow/position", "elbow_pos"])
def test_a_lock_that_the_log_contradicts_is_refused_short_and_long_alike(
    called, arm, write, read_long, rejected
):
    frame = arm[[c for c in arm if c.startswith(("t", "shoulder")) or c == "elbow.q"]]
    frame = frame.rename(columns={"elbow.q": called})
    with rejected(r"'elbow' is locked, but 'elbow\.q' moves by 4\.\d+ \(-"):
        locked(frame)
    known = Conventions.of(Robot.load("two-link", lock=["elbow"]))
    with rejected(r"take the lock out, or give a stretch"):
        read_long(write("log.csv", frame), known)
    still = np.where(np.arange(len(frame)) == 7, 3.0, 0.001)  # one wrong value moves nothing
    assert all("elbow' stands" not in note for note in locked(frame, **{called: still}))
    assert "lock it there, --lock elbow=0.5" in locked(frame, **{called: 0.5})[-1]


def test_a_joint_that_a_log_lacks_is_proposed_for_locking_before_other_names_are(arm, rejected):
    frame = arm.rename(columns=lambda c: c.replace("elbow", "finger"))
    with pytest.raises(IdentifiabilityError) as told:
        Log.from_frame(frame, "log", known())
    said = str(told.value)
    assert "no column elbow.q, elbow.tau" in said
    assert 0 < said.index("lock=['elbow']).") < said.index("If one of finger is it, add Robot")
    every = frame.rename(columns=lambda c: c.replace("shoulder", "thumb"))
    with rejected(
        r"thumb, finger is it, add .*columns={'OLD': 'shoulder'}.*\[columns\]",
    ):
        Log.from_frame(every.assign(**{"heat [°C]": 30.0}), "log", known())


def partly(frame, tau):
    """Samples of the two-link arm of which the elbow's torque is so."""
    spoilt = frame.drop(columns="elbow.tau") if tau is None else frame.assign(**{"elbow.tau": tau})
    log = Log.from_frame(spoilt, "log", known())
    return log, prepare_log(Robot.load("two-link"), log, Preparation(keep_rest=True))


@pytest.mark.parametrize("tau", [None, np.nan])
def test_a_joint_without_torque_keeps_its_motion_and_loses_its_equations(tau, arm, two_link):
    log, samples = partly(arm, tau)
    assert log.unmeasured[:, 1].all()
    how = Preparation(keep_rest=True)
    whole = prepare_log(two_link, Log.from_frame(arm), how)
    assert_array_equal(samples.motion.q, whole.motion.q)
    assert not samples.weight[:, 1].any()
    assert Log.from_frame(log.to_frame(), "log", known()).rows(3, 9).unmeasured[:, 1].all()
    result = analyze("two-link", arm.assign(**{"elbow.tau": np.nan}), replicates=0)
    full = analyze("two-link", arm, replicates=0)
    ours, theirs = (r.to_frame().set_index("name")["value"] for r in (result, full))
    for name in ("link1.mx", "link2.mx", "link1.Iyy"):  # the shoulder's torque has them, too
        assert ours[name] == pytest.approx(theirs[name], rel=1e-6)
    (said,) = of_key(result.hints, "unmeasured")
    assert "'elbow.tau' is empty or not there in every row" in said


def test_torque_that_is_missing_for_a_while_is_left_out_there(arm, two_link):
    gone = np.isin(np.arange(len(arm)), [7, *range(60, 90)])
    log, samples = partly(arm, np.where(gone, np.nan, arm["elbow.tau"]))
    assert_array_equal(samples.weight[:, 1], ~gone)
    assert samples.weight[:, 0].all()
    (said,) = of_key(read_recordings([log]).hints, "silent")
    assert "'elbow.tau' in 31 of" in said
    assert said.numbers["rows"] == 31
    assert np.isfinite(log.tau).all()
    # Decimated, the filter mixes what is missing with what is beside; one value alone is known.
    how = Preparation(derivatives="butterworth", cutoff=5.0, decimate=4, keep_rest=True)
    found = prepare_log(two_link, log, how).weight[:, 1] == 0
    assert found[56:94].all()
    assert not found[:50].any()


def test_a_log_whose_torque_is_all_empty_is_refused(arm, rejected):
    with rejected("log has no torque"):
        partly(arm.assign(**{"shoulder.tau": np.nan}), np.nan)
