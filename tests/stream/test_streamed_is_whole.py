"""A log that is read in parts gives what it gives as a whole, whatever the parts."""

import mmap

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    Log,
    Model,
    Preparation,
    Regression,
    Robot,
    analyze,
    find_base_parameters,
    gather_information,
    prepare_log,
)
from identifiability.estimation.prediction import predict
from identifiability.foundation.engines import Serial
from identifiability.logs import rows

from ..marks import everything

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def found(name, path, how=None):
    """All that is made of the rows of a file."""
    robot = Robot.load(name)
    model = Model.of(*EFFECTS)
    samples = prepare_log(robot, Log.read(path), how, engine=Serial())
    regression = Regression(robot, model, (samples,), find_base_parameters(robot, model).kept)
    information = gather_information(regression)
    R = information.factor()
    values = np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=None)[0][:, None]
    parts = len(regression.parts())
    rows = rows_of(regression)
    notes = (samples.notes, samples.outputs, samples.sha256, samples.hints, samples.starts)
    return rows, notes, samples.survey, information, R, values, predict(regression, values), parts


def rows_of(regression):
    found = [(c.start, c.W.copy(), c.tau, c.t) for c in regression.chunks()]
    assert [f[0] for f in found] == np.cumsum([0, *(len(f[2]) for f in found[:-1])]).tolist()
    return [np.concatenate(x) for x in list(zip(*found, strict=True))[1:]]


def assert_same(whole, parts):
    assert whole[-1] == 1 < parts[-1]
    for found, wanted in zip(parts[0], whole[0], strict=True):
        assert found.shape == wanted.shape
        assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    assert parts[1] == whole[1]
    for name, wanted in vars(whole[2]).items():
        assert_allclose(getattr(parts[2], name), wanted, rtol=1e-8, err_msg=name)
    assert_array_equal(parts[3].counts, whole[3].counts)
    R, other = (x / np.linalg.norm(whole[4], axis=0) for x in (whole[4], parts[4]))
    assert_allclose(other.T @ other, R.T @ R, rtol=0, atol=1e-8)
    expected = whole[6]
    found = parts[6]
    assert found.relative_error() == pytest.approx(expected.relative_error(), rel=1e-7)
    assert found.joint_error() == pytest.approx(expected.joint_error(), rel=1e-7)
    assert found.constant_error() == pytest.approx(expected.constant_error(), rel=1e-7)


@pytest.mark.parametrize("name, form", [("3-rps", "parquet"), ("six-dof-arm", "csv")])
def test_given_derivatives(name, form, sizes, frame_of, saved):
    path = saved(frame_of(name, periods=4, samples=900), form)
    whole = found(name, path)
    sizes()
    assert_same(whole, found(name, path))


@pytest.mark.parametrize("name", [everything("3-rps"), "six-dof-arm"])
def test_filtered_derivatives_and_decimation(name, sizes, frame_of, saved):
    frame = frame_of(name, periods=4, samples=1500, derivatives=False)
    path = saved(frame)
    whole = found(name, path)
    assert "one row in " in "".join(whole[1][0])
    sizes()
    assert_same(whole, found(name, path))


@pytest.mark.parametrize("piece", [211, 4096])
@pytest.mark.parametrize("window", [None, 256])
def test_dwells_whatever_the_pieces(piece, window, sizes, few_windows, frame_of, saved):
    if window:
        few_windows(window)
    frame = frame_of("two-link", periods=6, samples=1500, derivatives=False)
    still = frame.copy()
    for start in (700, 3100, 5950, 8900):  # held for half a second, across the seams too
        rows = slice(start, start + 400)
        for column in still:
            if column.endswith(".q"):
                still.loc[still.index[rows], column] = still[column].iloc[start]
    path = saved(still)
    whole = found("two-link", path, Preparation(cutoff=20.0))
    assert "a fit skips joints while they stand still" in "".join(whole[1][0])
    assert ("windows" in "".join(whole[1][0])) == (window is not None)
    sizes(piece=piece, shortest=1700, rows=piece // 2, characters=40 * piece)
    assert_same(whole, found("two-link", path, Preparation(cutoff=20.0)))


#: Some lost samples at the seams of pieces, and two long gaps with a short stretch between.
LOST = [*range(690, 703), *range(1399, 1401), 2800, *range(3500, 3700), *range(3706, 3900), 4444]


@pytest.mark.parametrize("decimate, given", [(1, True), (4, True), (None, False)])
def test_gaps(decimate, given, sizes, frame_of, saved):
    frame = frame_of("two-link", periods=5, derivatives=given).drop(index=LOST).reset_index()
    path = saved(frame)
    how = Preparation(decimate=decimate)
    whole = found("two-link", path, how)
    assert len(whole[1][3]) == 1
    sizes()
    assert_same(whole, found("two-link", path, how))


def test_only_rows_of_long_logs_stay_on_the_disk(frame_of, saved, monkeypatch):
    frame = frame_of("two-link", periods=2)
    paths = saved(frame), saved(frame, "csv")
    assert not any(Log.read(p).long for p in paths)
    monkeypatch.setattr(rows, "LONG", 1000)
    long = [*map(Log.read, paths), Log.from_frame(frame)]
    for log in long:
        assert log.long
        assert isinstance(log.q.base.base.obj, mmap.mmap)
        assert_allclose(log.q[1500:], long[0].q[1500:], rtol=1e-12)
    assert analyze("two-link", long[1], "none", replicates=0).information.samples == len(frame)


def test_a_full_disk_is_said(frame_of, saved, monkeypatch, tmp_path, rejected):
    path = saved(frame_of("two-link", periods=2))
    monkeypatch.setattr(rows, "LONG", 1000)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "nowhere"))
    with rejected("rows of a long log do not fit on the disk"):
        Log.read(path)
