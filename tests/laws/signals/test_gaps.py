"""Lost samples: short gaps are bridged, long ones split a log, and nothing is computed across."""

from contextlib import nullcontext
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import (
    IdentifiabilityError,
    Log,
    Model,
    Preparation,
    Regression,
    find_base_parameters,
    gather_information,
    prepare_log,
)
from identifiability.logs.gaps import Gaps
from identifiability.logs.signals import has_gap
from identifiability.logs.spectrum import bandwidth_of_windows, noise_level
from identifiability.workflows.diagnose.forward import _stretches

#: Step [s], cut-off [Hz]: half of its period is 25.8 steps.
DT, CUTOFF = 0.002, 9.7


def frame(rows, *, derivatives=False, jitter=0.0):
    t = DT * np.asarray(rows)
    w = 2 * np.pi * np.array([0.8, 1.1])
    q = np.sin(np.outer(t, w))
    dq = w * np.cos(np.outer(t, w))
    table = {"t": t + jitter}
    for k, joint in enumerate(("shoulder", "elbow")):
        table |= {f"{joint}.q": q[:, k], f"{joint}.tau": np.cos(3 * q[:, k]) + dq[:, k]}
        if derivatives:
            table |= {f"{joint}.dq": dq[:, k], f"{joint}.ddq": -(w[k] ** 2) * q[:, k]}
    return pd.DataFrame(table)


def without(total, *gaps):
    """All rows but those lost after each row: (row, lost)."""
    rows = np.arange(total)
    return rows[[not any(a < r <= a + lost for a, lost in gaps) for r in rows]]


def prepared(two, rows, **how):
    log = Log.from_frame(frame(rows), "log")
    return prepare_log(two, log, Preparation(**{"cutoff": CUTOFF, "keep_rest": True, **how}))


def test_bridged_gaps_change_the_motion_by_what_a_cubic_misses(two):
    """A twentieth of the rows once stretched time by as much: inertias erred by a tenth."""
    whole = prepared(two, np.arange(4000), decimate=1)
    some = np.flatnonzero(default_rng(9).random(4000) >= 0.05)
    one = [(without(4000, (2000, lost)), 0, 3e-5) for lost in (1, 5, 11)]
    for rows, ends, error in (*one, (some, 100, 1e-3)):
        s = prepared(two, rows, decimate=1)
        lost = 4000 - len(rows)
        assert s.hints == ()
        assert any(f"{lost} lost samples (gaps of up to" in note for note in s.notes)
        same = np.isin(np.round(whole.motion.t / DT), np.round(s.motion.t / DT))
        inner = slice(ends, len(rows) - ends)
        for name in ("actuated_q", "actuated_v", "actuated_a"):
            found = getattr(s.motion, name)
            wanted = getattr(whole.motion, name)[same]
            atol = error * np.abs(wanted).max()
            assert_allclose(found[inner], wanted[inner], rtol=0, atol=atol)


@pytest.mark.parametrize("lost, split", [(24, False), (25, True), (300, True)])
def test_a_gap_is_bridged_below_half_of_the_period_of_the_cut_off(two, lost, split):
    s = prepared(two, without(4000, (1999, lost)))
    assert len(s.breaks) == split == len(s.hints)
    assert not split or "after data row 2000: it was taken as 2 stretches" in s.hints[0]
    assert s.lost == split
    assert sum("next to long gaps" in note for note in s.notes) == split


def test_stretches_are_what_they_are_by_themselves(two):
    rows = without(5000, (1499, 100), (3199, 1000))
    s = prepared(two, rows, decimate=1)
    cuts = [0, 1500, 3100, len(rows)]
    for a, b in pairwise(cuts):
        alone = prepared(two, rows[a:b], decimate=1).motion
        own = s.motion[(s.motion.kept >= a) & (s.motion.kept < b)]
        first = 1 if a else 0  # that of a later stretch is left out, which tells the others
        for name in ("actuated_q", "actuated_v", "actuated_a"):
            assert_allclose(getattr(own, name), getattr(alone, name)[first:], rtol=0, atol=1e-8)
    assert np.flatnonzero(np.diff(s.motion.kept) > 1).tolist() == [1499, 3098]


def test_neither_outputs_nor_blocks_reach_across_a_gap(two):
    rows = without(5000, (1499, 100), (3199, 1000))
    s = prepared(two, rows, decimate=1)
    decimated = prepared(two, rows)
    assert decimated.decimation is not None
    before = np.searchsorted(decimated.output_times(), DT * np.array([1500, 4000]))
    assert decimated.starts == (0, *before)
    for start, stop, _ in decimated.runs:
        assert np.ptp(decimated.motion.t[start:stop]) < (stop - start) * DT
    model = Model.of("rigid_body")
    for samples in (s, decimated):
        regression = Regression(two, model, (samples,), find_base_parameters(two, model).kept)
        counts = gather_information(regression, 7).counts
        assert set(samples.starts) <= {0, *np.cumsum(counts)}
        assert counts.sum() == samples.outputs


def test_a_stretch_shorter_than_a_period_of_the_cut_off_is_left_out(two):
    rows = without(4000, (1999, 100), (2099 + 51, 100))  # 51 samples between, a period is 51.5
    s = prepared(two, rows, decimate=1)
    assert s.lost == 51 + 1
    assert not np.isin(np.arange(2000, 2051), s.motion.kept).any()
    assert prepared(two, without(4000, (1999, 100), (2099 + 52, 100))).lost == 2


def test_the_band_is_that_of_the_motion_and_not_of_its_gaps(two):
    chosen = [
        prepared(two, rows, cutoff=None)
        for rows in (np.arange(6000), without(6000, (1999, 700), (4999, 4)))
    ]
    bin_width = 10 / 4.6  # the longest stretch lasts 4.6 s, and the cut-off is ten bandwidths
    assert chosen[1].cutoff == pytest.approx(chosen[0].cutoff, abs=2 * bin_width)
    assert "noise" not in chosen[1].notes[0]  # which steps of the position would look like
    one = np.arange(1000.0)[:, None]
    other = np.sin(0.3 * np.arange(400.0))[:, None]
    assert bandwidth_of_windows([one, other], 0.01) == bandwidth_of_windows([one], 0.01)


def test_a_late_stamp_is_no_gap_and_an_uneven_clock_is_refused(two, rejected):
    late = np.zeros(2000)
    late[700] = 0.9 * DT
    s = prepare_log(two, Log.from_frame(frame(np.arange(2000), jitter=late)))
    assert (s.hints, len(s.breaks)) == ((), 0)
    assert any("jitter by 90 % of a step" in note for note in s.notes)
    assert not any("lost samples" in note for note in s.notes)
    log = Log.from_frame(frame(np.cumsum(np.tile([1, 1, 9], 700))), "log")
    with rejected("log is sampled so unevenly"):
        prepare_log(two, log)


def test_a_log_with_derivatives_of_its_own_loses_nothing_at_short_gaps(two):
    for lost, split in ((10, 0), (100, 1)):
        log = Log.from_frame(frame(without(2000, (999, lost)), derivatives=True))
        s = prepare_log(two, log, Preparation(keep_rest=True))
        assert len(s.tau) == 2000 - lost - split
        assert len(s.hints) == split


def test_repeated_values_are_not_interpolated_from_beyond_a_gap(two):
    rows = without(3000, (1499, 300))
    table = frame(rows)
    for joint in ("shoulder", "elbow"):  # the last but one before the gap repeats
        table.loc[1498, f"{joint}.q"] = table.loc[1497, f"{joint}.q"]
    found = prepare_log(two, Log.from_frame(table), Preparation(cutoff=40.0, decimate=1))
    true = prepared(two, rows, cutoff=40.0, decimate=1)
    inside = slice(1300, 1500)
    assert any("the logger repeated old values" in note for note in found.notes)
    assert_allclose(
        found.motion.actuated_q[inside], true.motion.actuated_q[inside], rtol=0, atol=1e-6
    )


def test_gaps_of_a_part_of_a_file_are_counted_from_its_first_row(tmp_path, read_long):
    path = tmp_path / "log.parquet"
    frame(without(3000, (999, 5), (1999, 50))).to_parquet(path, index=False)
    whole = read_long(path)
    part = whole.rows(900, 2500, "part").rows(10, 1500, "p")
    t = Log.read(path).t
    found = Gaps.of("p", part.clock, [part.rows(0, len(part)).t])
    assert found.rows.tolist() == [999 - 910, 1994 - 910]
    assert_allclose(found.t, t[[999, 1994]])
    assert found.lost.tolist() == [5, 50] == Gaps.of("p", whole.clock, [t]).lost.tolist()


def test_noise_is_not_that_of_jumps_across_gaps():
    t = DT * without(3000, (999, 40), (1999, 400))
    x = np.sin(8 * t)[:, None] + 1e-3 * default_rng(3).standard_normal((len(t), 1))
    assert noise_level(x, t) == pytest.approx(1e-3, rel=0.05)
    assert noise_level(x)[0] > 4e-3  # as one stretch the jumps would be noise
    assert noise_level(x[:1000], t[:1000]) == noise_level(x[:1000])


def test_nothing_is_simulated_forward_along_a_bridged_gap(two):
    s = prepared(two, without(2000, (700, 5)), decimate=1)
    starts = [int(rows[0]) for _, rows in _stretches([s], DT, 100, 10**6)]
    assert len(starts) > 15
    assert not any(k <= 700 < k + 100 for k in starts)


def test_uneven_steps_that_add_up_are_said(two):
    for share, said in ((0.004, 0), (0.05, 1)):
        t = np.cumsum(DT * (1 + 0.45 * (default_rng(5).random(3000) < share)))
        s = prepare_log(two, Log.from_frame(frame(t / DT)), Preparation(cutoff=CUTOFF))
        assert len(s.hints) == said
        assert not said or "sampled unevenly: the mean step is 2.5 % off" in s.hints[0]
    noise = 0.3 * DT * default_rng(6).uniform(-1, 1, 3000)
    jitter = Log.from_frame(frame(np.arange(3000), jitter=noise))
    assert prepare_log(two, jitter, Preparation(cutoff=CUTOFF)).hints == ()


def test_a_step_of_one_and_a_half_usual_ones_is_a_gap():
    assert has_gap(np.array([0, 1, 2, 3.4, 4.4, 6.0])).tolist() == [False] * 4 + [True]


@pytest.mark.parametrize("share", [0.02, 0.05, 0.1, 0.25])
@pytest.mark.parametrize("jitter", [0.0, 0.1])
def test_rows_lost_at_random_are_lost_samples_and_no_jitter(share, jitter):
    rng = default_rng(7)
    rows = np.flatnonzero(rng.random(4000) >= share)
    t = DT * (rows + jitter * rng.uniform(-1, 1, len(rows)))
    clock = Log.from_frame(frame(rows).assign(t=t)).clock
    found = Gaps.of("log", clock, [t])
    assert found.lost.sum() == pytest.approx(rows[-1] - rows[0] + 1 - len(rows), rel=0.02)
    assert found.usual <= 2 * jitter + 1e-9
    assert abs(found.drift) < 0.01
    found.check(len(rows))


def test_a_burst_of_late_stamps_is_no_gap():
    t = DT * np.arange(3000.0)
    t[1000:1004] += DT * np.array([2.7, 1.9, 1.1, 0.45])  # they arrive together
    log = Log.from_frame(frame(t / DT))
    assert len(Gaps.of("log", log.clock, [log.t])) == 0


def test_gaps_that_are_many_are_refused_unless_they_are_whole_steps():
    rng = default_rng(8)
    for more, refused in ((rng.random(3000) < 0.9, False), (2 * rng.random(3000), True)):
        log = Log.from_frame(frame(np.cumsum(1.0 + np.where(np.arange(3000) % 2, more, 0.0))))
        found = Gaps.of("log", log.clock, [log.t])
        assert len(found) > 0.25 * len(log)
        with pytest.raises(IdentifiabilityError, match="so unevenly") if refused else nullcontext():
            found.check(len(log))
