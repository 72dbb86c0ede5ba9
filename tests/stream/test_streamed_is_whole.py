"""A log that is read in parts gives what it gives as a whole, whatever the parts."""

import numpy as np
import pytest

from identifiability import analyze
from identifiability.estimation.prediction import predict
from identifiability.foundation.engines import Serial
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.regression.information import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import find_base_parameters
from identifiability.robot import Robot

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def both(name, path, how=None):
    """The regressions of a file in memory and streamed."""
    robot, model = Robot.load(name), Model.of(*EFFECTS)
    kept = find_base_parameters(robot, model).kept
    whole = prepare_log(robot, Log.read(path), how)
    parts = prepare_log(robot, Log.scan(path), how, engine=Serial())
    return [Regression(robot, model, (samples,), kept) for samples in (whole, parts)]


def rows_of(regression):
    found = [(c.start, c.W.copy(), c.tau, c.t, c.velocity) for p in regression.parts()
             for c in p.chunks()]  # fmt: skip
    assert [f[0] for f in found] == np.cumsum([0, *(len(f[2]) for f in found[:-1])]).tolist()
    return [np.concatenate(x) for x in list(zip(*found, strict=True))[1:]]


def assert_same(whole, parts):
    assert len(parts.samples[0].stretches) > 1
    for found, wanted in zip(rows_of(parts), rows_of(whole), strict=True):
        assert found.shape == wanted.shape
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    a, b = whole.samples[0], parts.samples[0]
    assert (a.notes, a.outputs, a.sha256) == (b.notes, b.outputs, b.sha256)
    for name, wanted in vars(a.survey).items():
        np.testing.assert_allclose(getattr(b.survey, name), wanted, rtol=1e-8, err_msg=name)
    one, two = gather_information(whole), gather_information(parts)
    np.testing.assert_array_equal(one.counts, two.counts)
    R = one.factor()
    R, other = (x / np.linalg.norm(R, axis=0) for x in (R, two.factor()))
    np.testing.assert_allclose(other.T @ other, R.T @ R, rtol=0, atol=1e-8)
    R = one.factor()
    values = np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=None)[0][:, None]
    expected, found = predict(whole, values), predict(parts, values)
    assert found.relative_error() == pytest.approx(expected.relative_error(), rel=1e-8)
    assert found.joint_error() == pytest.approx(expected.joint_error(), rel=1e-8)
    assert found.constant_error() == pytest.approx(expected.constant_error(), rel=1e-8)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("3-rps", "parquet"),
        ("six-dof-arm", "csv"),
        pytest.param("3-rps", "csv", marks=pytest.mark.everything),
        pytest.param("six-dof-arm", "parquet", marks=pytest.mark.everything),
    ],
)
def test_given_derivatives(name, form, sizes, frame_of, saved):
    assert_same(*both(name, saved(frame_of(name, periods=4, samples=900), form)))


@pytest.mark.parametrize(
    "name", [pytest.param("3-rps", marks=pytest.mark.everything), "six-dof-arm"]
)
def test_filtered_derivatives_and_decimation(name, sizes, frame_of, saved):
    frame = frame_of(name, periods=4, samples=1500, derivatives=False)
    whole, parts = both(name, saved(frame))
    assert whole.samples[0].decimation is not None
    assert_same(whole, parts)


@pytest.mark.parametrize("piece", [211, 1000, 4096])
@pytest.mark.parametrize("window", [None, 256])
def test_dwells_whatever_the_pieces(piece, window, sizes, frame_of, saved):
    sizes(piece=piece, shortest=1700, rows=piece // 2, characters=40 * piece, window=window)
    frame = frame_of("two-link", periods=6, samples=1500, derivatives=False)
    still = frame.copy()
    for start in (700, 3100, 5950, 8900):  # held for half a second, across the seams too
        rows = slice(start, start + 400)
        for column in still:
            if column.endswith(".q"):
                still.loc[still.index[rows], column] = still[column].iloc[start]
    path = saved(still)
    whole, parts = both("two-link", path, Preparation(cutoff=20.0))
    assert "a joint that stands" in "".join(whole.samples[0].notes)
    assert ("windows" in "".join(whole.samples[0].notes)) == (window is not None)
    assert_same(whole, parts)


@pytest.mark.parametrize("decimate", [1, 4])
def test_gaps_in_logs_with_derivatives(decimate, sizes, frame_of, saved):
    frame = frame_of("two-link", periods=5)
    frame = frame.drop(index=[*range(690, 703), *range(1399, 1401), 2800, 4444]).reset_index()
    whole, parts = both("two-link", saved(frame), Preparation(decimate=decimate))
    assert_same(whole, parts)


def test_only_long_files_are_streamed(sizes, frame_of, saved, monkeypatch):
    from identifiability.logs import tables

    frame = frame_of("two-link", periods=2)
    paths = saved(frame), saved(frame, "csv")
    assert all(not Log.open(p).long for p in paths)
    monkeypatch.setattr(tables, "LONG", 5000)
    assert all(Log.open(p).long for p in paths)
    assert analyze("two-link", paths[1], replicates=0).information.samples == len(frame)
