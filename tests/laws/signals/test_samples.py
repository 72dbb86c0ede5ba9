"""From a log to samples: the grid, gaps, and columns that contradict each other."""

from dataclasses import replace
from operator import itemgetter
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    Dataset,
    IdentifiabilityError,
    Log,
    Model,
    Preparation,
    Regression,
    gather_information,
    prepare_log,
)
from identifiability.logs.contradictions import check_units, contradictions
from identifiability.logs.prepare.dataset import explain_silence, find_signal
from identifiability.logs.signals import Decimation
from identifiability.robot import complete_motion


def wave(t):
    w = 2 * np.pi * (0.8 + 0.3 * np.arange(2))
    return np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w)), -(w**2) * np.sin(np.outer(t, w))


def log_of(t, **channels):
    q, dq, ddq = wave(t)
    given = {"q": q, "tau": q, "dq": dq, "ddq": ddq, **channels}
    frame = {"t": t}
    for k, joint in enumerate(("shoulder", "elbow")):
        for kind, x in given.items():
            if x is not None:
                frame[f"{joint}.{kind}"] = x[:, k]
    return Log.from_frame(pd.DataFrame(frame), "log")


def samples_of(two, kept, factor, own=None):
    """Samples at some rows of a log; the torque is the row."""
    kept = np.asarray(kept)
    motion = replace(complete_motion(two, 0.01 * kept, *wave(0.01 * kept)), kept=kept)
    tau = np.repeat(kept[:, None], 2, axis=1).astype(float)
    d = Decimation(factor) if factor > 1 else None
    return Dataset("log", motion, tau, d, (), "", own)


@pytest.mark.parametrize("factor", [2, 3])
@pytest.mark.parametrize("own", [None, (60, 171)])
def test_outputs_are_at_every_nth_row_whose_neighbours_are_all_there(two, factor, own):
    kept = np.r_[5:96, 97:99, 101:900]
    s = samples_of(two, kept, factor, own)
    reach = 10 * factor
    there = set(kept.tolist())
    low, high = own or (0, 900)
    rows = [
        r for r in range(0, 900, factor)
        if low <= r < high and all(k in there for k in range(r - reach, r + reach + 1))
    ]  # fmt: skip
    assert s.outputs == len(rows) > 0
    assert_allclose(s.output_times(), 0.01 * np.array(rows))
    for start, stop, _ in s.runs:
        assert (np.diff(kept[start:stop]) == 1).all()
    for size in (25, 10**6):
        pieces = list(s.pieces(size))
        # A straight line keeps its values under a symmetric filter.
        down = np.concatenate([p.down(p.tau) for p in pieces])
        assert_allclose(down[:, 0], rows, atol=1e-9)
        at = np.concatenate([p.tau[p.at, 0] for p in pieces])
        assert_array_equal(at, rows)


def test_what_is_no_data_is_so_of_columns_and_torque_alike(two):
    """Torque that the columns explain is explained beside joints that stand, too."""
    factor = 96
    rows = np.arange(3, 3000)
    s = samples_of(two, rows, 1)
    stands = ((rows // 211) % 2 == 0)[:, None] & np.array([True, False])
    s = replace(s, tau=s.motion.actuated_a, decimation=Decimation(factor, 3), weight=1.0 - stands)
    for p in s.pieces(10**6):
        few = p.sparse
        column = few.weighed(few.down(few.silenced(few.motion.actuated_a.copy())))
        assert 0 < p.moves[:, 0].sum() < len(p.moves)
        assert_allclose(column, p.torque, atol=2e-3 * np.abs(s.tau).max())


def test_decimation_keeps_the_band_up_to_the_cut_off(two):
    """Every int(½ / (f_c Δ))-th sample: the new Nyquist frequency is at least the cut-off."""
    t = 0.002 * np.arange(4000)
    log = log_of(t, dq=None, ddq=None)
    for cutoff, factor in ((10.0, 24), (60.0, 4)):
        d = prepare_log(two, log, Preparation(cutoff=cutoff, keep_rest=True)).decimation
        assert d.factor == factor
    longer = log_of(0.002 * np.arange(9000), dq=None, ddq=None)
    slow = prepare_log(two, longer, Preparation(cutoff=2.0, keep_rest=True)).decimation
    assert slow.factor == 120
    given = prepare_log(two, log_of(t), Preparation(keep_rest=True))
    assert given.decimation is None  # measured derivatives need no filter
    wanted = prepare_log(two, log_of(t), Preparation(decimate=7, keep_rest=True))
    assert wanted.decimation.factor == 7


def test_few_samples_of_a_smooth_motion_make_the_columns_however_few_fit_into_memory(
    two, monkeypatch
):
    log = log_of(0.002 * np.arange(4000), dq=None, ddq=None)
    samples = prepare_log(two, log, Preparation(cutoff=10.0))
    model = Model.of("rigid_body", "coulomb_friction")
    every = replace(samples, decimation=Decimation(24))
    whole = gather_information(Regression(two, model, (every,))).factor()
    compute, rows = Model.regressor, []
    count = lambda *given: rows.append(len(given[2])) or compute(*given)  # noqa: E731
    monkeypatch.setattr(Model, "regressor", count)
    monkeypatch.setattr("identifiability.regression.regression.BLOCK_BYTES", 40_000)
    few = gather_information(Regression(two, model, (samples,))).factor()
    # Bodies and friction have a regressor each.
    assert 2.0 < 3 * sum(rows) / len(log) < 2.4
    length = np.linalg.norm(whole, axis=0)
    assert (np.abs(few.T @ few - whole.T @ whole) <= 2e-4 * np.outer(length, length)).all()


def test_derivatives_are_those_of_the_motion_inside_a_log(two):
    t = 0.002 * np.arange(6000)
    exact = wave(t)
    for log in (log_of(t, dq=None, ddq=None), log_of(t, ddq=None)):
        m = prepare_log(two, log, Preparation(cutoff=20.0, decimate=1)).motion
        for found, x in zip((m.actuated_q, m.actuated_v, m.actuated_a), exact, strict=True):
            inside = np.abs(found - x)[500:-500]
            assert inside.max() < 1e-3 * np.abs(x).max()
    # Given velocities are differentiated once, and are not made anew from the positions.
    other = log_of(t, dq=1.5 * exact[1], ddq=None)  # a remark, and not refused
    m = prepare_log(two, other, Preparation(cutoff=20.0, decimate=1)).motion
    for found, x in ((m.actuated_v, exact[1]), (m.actuated_a, exact[2])):
        inside = np.abs(found - 1.5 * x)[500:-500]
        assert inside.max() < 2e-3 * np.abs(x).max()


def test_the_survey_says_whether_there_is_anything_to_explain(two):
    t = 0.01 * np.arange(50)
    m = replace(complete_motion(two, t, *wave(t)), dropped=np.arange(3, 9))
    tau = np.stack([np.linspace(-1, 4, 50), np.full(50, 3.0)], 1)
    data = Dataset("log", m, tau, None, (), "")
    whole = data.survey
    parts = [data.take(slice(20)).survey, data.take(slice(20, None)).survey]
    (said,) = data.describe(two.joints, 56)
    assert "6 of 56 samples" in said
    assert "4, 5, 6, 7, 8 and 1 more" in said
    # The first joint's torque changes, the second one's does not; no torque matters at rest.
    assert find_signal([whole]).tolist() == [True, False]
    assert find_signal(parts).tolist() == [True, False]
    assert explain_silence([whole]) == ""
    still = replace(whole, high=whole.low + 1e-10)
    assert not find_signal([still]).any()
    assert "does not move" in explain_silence([still])
    elsewhere = replace(still, low=still.low + 0.1, high=still.high + 0.1)
    assert find_signal([still, elsewhere]).tolist() == [True, False]  # at rest at two places
    constant = replace(whole, torque_range=np.array([[-1.0, 3.0], [-1.0, 3.0]]))
    assert "torque never changes" in explain_silence([constant])


# --- contradictions and units -----------------------------------------------------------------

T = 0.01 * np.arange(1500)


def remarks(**channels):
    return [f"{c.joint}.{c.kind}" for c in contradictions(log_of(T, **channels))]


@pytest.mark.parametrize(
    "factor, clean", [(1.0, True), (1.24, True), (1.26, False), (0.81, True), (0.79, False)]
)
def test_a_velocity_that_is_too_large_or_small_by_a_quarter_contradicts(factor, clean):
    """Integrated, it must be multiplied by .8 … 1.25 to be the position."""
    assert remarks(dq=wave(T)[1] * [1.0, factor], ddq=None) == ["elbow.dq"] * (not clean)


def test_noise_offsets_and_gaps_do_not_contradict(rng):
    q, dq, _ddq = wave(T)
    assert remarks() == []
    assert remarks(dq=dq + 3.0) == []  # an offset of the rate is a drift
    assert remarks(dq=dq + 2 * rng.standard_normal(dq.shape), ddq=None) == []
    assert remarks(q=1e-3 * rng.standard_normal(q.shape), ddq=None) == []  # no motion to compare
    assert remarks(q=1 + 0 * q, dq=0 * q, ddq=0 * q) == []
    log = log_of(T)
    for holes in (np.r_[0:700, 900:1500], np.r_[0:700, 703:1500]):  # 200 steps, and 4
        cut = log.each(itemgetter(holes), t=T[holes])
        moved = cut.q + 5.0 * (holes > 701)[:, None]
        assert contradictions(replace(cut, q=moved)) == []


@pytest.mark.parametrize("size, compared", [(3.5, False), (5.0, True)])
def test_motion_is_compared_where_it_stands_out_four_times_from_single_samples(size, compared):
    """The rms of the motion in units of the white noise of its samples."""
    q, dq, _ = wave(T)
    noisy = q * np.sqrt(2) * size * 1e-3 + 1e-3 * default_rng(0).standard_normal(q.shape)
    turned = -1e-3 * size * np.sqrt(2) * dq  # of the wrong sign
    assert remarks(q=noisy, dq=turned, ddq=None) == ["shoulder.dq", "elbow.dq"] * compared


def test_columns_of_another_joint_or_late_by_a_fifth_of_a_period_contradict(rng):
    _, dq, ddq = wave(T)
    assert remarks(dq=dq[:, ::-1]) == ["shoulder.dq", "elbow.dq", "shoulder.ddq", "elbow.ddq"]
    # 2π·.8 · .1 = .50 rad: sin² .50 = .23 of the variance is not explained
    assert "shoulder.dq" in remarks(dq=wave(T - 0.1)[1], ddq=None)
    for late in (0.016, -0.016):
        found = contradictions(log_of(T, dq=wave(T - late)[1]))
        assert_allclose([c.lag for c in found[:2]], late, atol=2e-3)
    assert remarks(dq=wave(T - 0.005)[1], ddq=None) == []  # backward differences
    (one,) = contradictions(log_of(T, ddq=ddq * [0.0, 1.0] + [1e-3, 0.0]))
    assert one.text.startswith("'shoulder.ddq' contradicts 'shoulder.dq' (its integral")
    # A driver at 1 kHz low-passes velocities; noise spoils a derivative more than this lag does.
    t = 1e-3 * np.arange(8000)
    q = wave(t)[0]
    noisy = q + 2e-4 * rng.standard_normal(q.shape)
    found = contradictions(log_of(t, q=noisy, dq=wave(t - 2.2e-3)[1], ddq=None))
    assert_allclose([c.lag for c in found], 2 * [2.2e-3], rtol=0.2)
    assert all(c.movable for c in found)


@pytest.mark.parametrize(
    "joint, unit, factor, kind",
    [
        ("hinge", "degrees", 180 / np.pi, "say .*angles='deg'"),
        ("slide", "mm", 1e3, "convert it to m"),
        ("slide", "cm", 1e2, "convert it to m"),
    ],
)
def test_positions_in_another_unit_are_named_by_the_limits(joint, unit, factor, kind, rejected):
    robot = SimpleNamespace(
        actuated=[0],
        is_prismatic=lambda k: joint == "slide",
        limits=np.array([[0.2, 0.9]]),
        angles=None,
    )
    q = np.linspace(0.25, 0.85, 200)[:, None]
    log = Log("log", (joint,), 0.01 * np.arange(200), q * factor, q, None, None, "")
    with rejected(f"looks like {unit}: {kind}"):
        check_units(robot, [log])
    check_units(robot, [replace(log, q=q)])


@pytest.mark.parametrize(
    "factor, refused",
    [(1.0, False), (1.9, False), (0.55, False), (2.1, True), (0.45, True), (-1.0, True),
     (180 / np.pi, True)],
)  # fmt: skip
def test_a_velocity_in_another_unit_is_named_with_its_factor(two, factor, refused):
    log = log_of(T, dq=wave(T)[1] * [1.0, factor], ddq=None)
    if not refused:
        check_units(two, [log])
        return
    with pytest.raises(
        IdentifiabilityError, match=r"'elbow.dq' is \S+ times the time derivative"
    ) as error:
        check_units(two, [log])
    assert float(str(error.value).split()[3]) == pytest.approx(factor, rel=0.01)
