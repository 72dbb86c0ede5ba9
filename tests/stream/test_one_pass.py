"""The regressor is what costs most; it is made once for each sample."""

import cloudpickle
import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from identifiability import analyze
from identifiability.effects import find_families
from identifiability.estimation import groups
from identifiability.estimation.prediction import predict
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, run_limited
from identifiability.logs import Log
from identifiability.logs.prepare import prepare_log
from identifiability.logs.tables import opened
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import (
    LogPart,
    Model,
    Regression,
    choose_windows,
    choose_within,
)
from identifiability.robot import Robot
from identifiability.workflows import session


class Elsewhere(Engine):
    """Sends items and results as another process gets them."""

    def _run(self, function, items):
        return (copied(run_limited(function, copied(item))) for item in items)


def copied(item):
    return cloudpickle.loads(cloudpickle.dumps(item))


@pytest.fixture
def made(monkeypatch):
    """Times of all samples whose regressor is made, by whether they are of a long log."""
    times = {}
    plain = LogPart._regressor

    def spied(self, piece, *others):
        times.setdefault(self.samples.long, []).extend(piece.motion.t[piece.at].tolist())
        return plain(self, piece, *others)

    monkeypatch.setattr(LogPart, "_regressor", spied)
    return times


def test_a_long_log_is_gone_through_once(made, sizes, frame_of, saved, monkeypatch):
    """But for the windows of it that alternatives of the model look at."""
    monkeypatch.setattr(session, "find_alternative", lambda _: None)
    sizes(window=100)
    path = saved(frame_of("two-link", periods=5))
    found = analyze("two-link", Log.scan(path), replicates=0, engine=Serial())
    assert not found.held_out.whole
    assert made[True] == Log.read(path).t.tolist()


def test_a_log_that_judges_is_gone_through_once(made, frame_of):
    one, other = (frame_of("two-link", periods=1, samples=700, seed=k) for k in (0, 1))
    other["t"] += 100.0
    analyze("two-link", one, validate=other, replicates=0, engine=Serial())
    times = [t for t in made[False] if t >= 100.0]
    assert len(times) == len(set(times)) == 700


def test_a_short_log_is_gone_through_once(made, frame_of):
    log = Log.from_frame(frame_of("two-link", periods=1, samples=700), "short")
    robot, model = Robot.load("two-link"), Model.of("rigid_body", "viscous_friction")
    regression = Regression(robot, model, (prepare_log(robot, log),))
    gather_information(regression)
    predict(regression, np.zeros((len(regression.parameters), 1)))
    assert made[False] == log.t.tolist()


def test_errors_of_windows_are_the_same_from_what_was_kept(sizes, frame_of, saved):
    sizes(window=150)
    robot, model = Robot.load("two-link"), Model.of("rigid_body", "viscous_friction")
    file = Log.scan(saved(frame_of("two-link", periods=6)))
    samples = prepare_log(robot, file, engine=Serial())

    def errors(engine):
        regression = Regression(robot, model, (samples,))
        if engine is not None:
            gather_information(regression, engine=engine)
        values = np.arange(len(regression.parameters), dtype=float)[:, None]
        return predict(regression, values, engine=engine)

    anew = errors(None)
    assert anew.samples == 1500 == len(anew.tau)
    assert anew.total == 6000
    for found in (errors(Serial()), errors(Elsewhere())):
        np.testing.assert_array_equal(found.t[0], anew.t[0])
        np.testing.assert_array_equal(found.series, anew.series)
        np.testing.assert_allclose(found.predicted, anew.predicted, rtol=1e-13)
        np.testing.assert_allclose(found.sums.absolute, anew.sums.absolute, rtol=1e-12)


def test_what_may_be_missing_is_looked_for_in_rows_that_were_kept(
    made, sizes, frame_of, saved, monkeypatch
):
    sizes(window=150)
    robot, model = Robot.load("two-link"), Model.of("rigid_body", "viscous_friction")
    file = Log.scan(saved(frame_of("two-link", periods=6)))
    regression = Regression(robot, model, (prepare_log(robot, file, engine=Serial()),))
    gather_information(regression)
    made.clear()
    (stribeck,) = find_families(["stribeck_friction"])
    for excerpt in (groups.EXCERPT, (600, 3, 100)):
        monkeypatch.setattr(groups, "EXCERPT", excerpt)
        dry = {("coulomb_friction", joint) for joint in robot.joints}
        found = groups.Missing.of(regression, [stribeck], dry)
        own = next(c for c in found.candidates if c.family is stribeck)
        column = found.entries[0, own.columns[0]]
        assert len(found.seen.y) == (1500 if excerpt[0] > 1500 else 300) == len(column)
        v = np.concatenate([p.motion.actuated_v[p.at] for p in found.seen.pieces])[found.seen.seen]
        expected = np.sign(v[:, 0]) * np.exp(-np.abs(v[:, 0]) / own.shape)
        np.testing.assert_allclose(column, expected, atol=0.2)
    assert not made


@pytest.mark.parametrize("counts", [(10,), (3, 0, 5), (2000, 70_000), (10**6, 10**5)])
@pytest.mark.parametrize("sizes", [(6_000, 6, 1_000), (10, 2, 5)])
def test_fewer_rows_lie_in_those_that_are_shown(counts, sizes):
    windows = choose_windows(counts)
    shown = [{k for a, b in own.tolist() for k in range(a, b)} for own in windows]
    chosen = [
        [k for a, b in own.tolist() for k in range(a, b)] for own in choose_within(windows, sizes)
    ]
    for every, own in zip(shown, chosen, strict=True):
        assert own == sorted(set(own))
        assert every.issuperset(own)
    total = sum(map(len, shown))
    assert (
        sum(map(len, chosen)) == total
        or 0 < sum(map(len, chosen)) <= sizes[1] * sizes[2] + sizes[2]
    )


@pytest.mark.parametrize("counts", [(10,), (3, 0, 5), (2000, 70_000), (99_999, 2), (10**8, 20, 3)])
def test_windows_lie_in_their_logs_and_do_not_overlap(counts):
    windows = choose_windows(counts)
    for count, own in zip(counts, windows, strict=True):
        edges = own.ravel()
        assert 0 <= edges[0] <= edges[-1] <= count
        assert (np.diff(edges) >= 0).all()
    shown = sum(int(np.diff(own).sum()) for own in windows)
    assert shown == sum(counts) or 40_000 <= shown <= 60_000


def test_windows_meet_a_periodic_motion_at_all_its_phases():
    for period in (2_000, 20_000, 50_000, 100_000):
        ((*windows,),) = choose_windows([10**6])
        phase = np.concatenate([np.arange(a, b) for a, b in windows]) % period
        most_left_out = np.diff(np.sort([0, *phase, period])).max()
        assert most_left_out < 0.2 * period


def test_the_end_of_a_file_is_read_once_until_the_file_changes(tmp_path, monkeypatch):
    path, footers = tmp_path / "log.parquet", []
    read = parquet.read_metadata
    monkeypatch.setattr(parquet, "read_metadata", lambda p: footers.append(p) or read(p))
    for rows in (3, 5):
        pd.DataFrame({"t": np.arange(float(rows))}).to_parquet(path)
        assert [opened(path).read().num_rows for _ in range(3)] == [rows] * 3
    assert footers == [path, path]
