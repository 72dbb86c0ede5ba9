"""Logs in containers, sheets and arrays: read as tables are, or refused by name."""

import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.io import savemat

from identifiability import Log, analyze
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import PLAIN
from identifiability.logs.formats.reader import READERS, check_there, reader
from identifiability.quality.recordings import read_recordings
from identifiability.robot.sidecar import MeasuredTorque

JOINTS = ("shoulder", "elbow")


@pytest.fixture
def arrays(bare):
    """The log as arrays, a column a joint."""
    both = {k: bare[[f"{j}.{k}" for j in JOINTS]].to_numpy() for k in ("q", "tau")}
    return {"t": bare["t"].to_numpy(), **both}


def same(log, arrays):
    log = log.select(JOINTS)
    for name, values in arrays.items():
        assert_allclose(getattr(log, name), values, rtol=1e-14)


def reverse(arrays):
    return {k: v[:, ::-1] if v.ndim == 2 else v for k, v in arrays.items()}


def test_arrays_are_a_log_in_the_robots_order(arrays, bare):
    log = Log.from_arrays(**arrays)
    same(log, arrays)
    same(Log.from_arrays(**arrays, joints=JOINTS), arrays)
    same(Log.from_arrays(**reverse(arrays), joints=JOINTS[::-1]), arrays)
    assert Log.from_arrays(**arrays, dq=arrays["q"]).channels == ("q", "dq", "tau")
    plain = analyze("two-link", bare, replicates=0)
    for given in (log, arrays):
        found = analyze("two-link", given, replicates=0)
        assert (found.models[0].estimate.value == plain.models[0].estimate.value).all()


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"tau": np.zeros((200, 3))}, r"q is 200×2, tau is 200×3; .* \(N, n\)"),
        ({"t": np.zeros((2, 3))}, r"t is 2×3, q is .*give t as \(N,\)"),
        ({"joints": ("a", "a")}, r"joints names a, a, which are not 2"),
        ({"q": "abc"}, r"q must be an array of numbers"),
    ],
)
def test_arrays_of_other_shapes_are_refused(change, sentence, arrays, rejected):
    with rejected(sentence):
        Log.from_arrays(**{**arrays, **change})


def test_npz_and_mat_are_read_and_said(arrays, known, tmp_path, refused):
    turned = {k: v.T for k, v in arrays.items()}
    npz = tmp_path / "log.npz"
    mat = tmp_path / "log.mat"
    for content in (arrays, turned):
        savemat(mat, arrays)
        np.savez(npz, **content)
        for path in (npz, mat):
            log = Log.read(path, known)
            same(log, arrays)
            assert log.notes[0].endswith("(in the robot's order)")
    some = {"state": turned, "cmd": {"q": 0 * arrays["q"]}}
    for content in ({"run3": turned}, {"log": some}, {"log": turned, "log2": turned}):
        savemat(mat, content)
        log = Log.read(mat, known)
        same(log, arrays)
    assert "'log2.tau[0]'" in str(log.notes)
    gained = replace(known, torque=MeasuredTorque(gain=1.0))
    for more in (1e3, np.ones(3)):
        np.savez(npz, t=arrays["t"], q=arrays["q"], current=arrays["tau"], more=more)
        same(Log.read(npz, gained), arrays)
    np.savez(npz, **reverse(arrays), joints=np.array(JOINTS[::-1]))
    log = Log.read(npz, known)
    same(log, arrays)
    assert log.notes == ()
    out = refused("analyze", "two-link", npz, "--map", "shoulder=x")
    assert "no column shoulder.q, shoulder.tau" in out


def test_containers_without_a_log_are_refused_by_name(arrays, known, tmp_path, rejected):
    npz = tmp_path / "log.npz"
    for content, sentence in (
        ({"a": arrays["q"]}, r"has no array 't' of times \[s\]; it holds a"),
        ({**arrays, "q": arrays["q"][:50]}, r"of 200 times .* other sizes have q 50×2"),
        ({"t": np.array([{}], object)}, "holds something else than arrays of numbers and text"),
    ):
        np.savez(npz, **content)
        with rejected(sentence):
            Log.read(npz, known)
    files = {".xls": "old sheet", ".pkl": "any program", ".h5": "HDF5"}
    files[".mat"] = r"version 7\.3 \(HDF5\), .*'-v7'\), or write CSV"
    for suffix, sentence in files.items():
        path = npz.with_suffix(suffix)
        path.write_bytes(b"MATLAB 7.3 MAT-file, Platform" + bytes(600))
        with rejected(sentence):
            Log.read(path, known)


def test_sheets_are_read_with_titles_and_units(
    bare, arrays, known, tmp_path, monkeypatch, rejected
):
    pytest.importorskip("openpyxl")
    path = tmp_path / "log.xlsx"
    given = bare.assign(t=1e3 * bare["t"])
    rows = [["Run 3", *[None] * 4], list(bare), ["ms", "rad", "rad", "Nm", "Nm"]]
    table = pd.DataFrame([*rows, *given.to_numpy().tolist()])
    with pd.ExcelWriter(path, engine="openpyxl") as book:
        table.to_excel(book, sheet_name="run", header=False, index=False)
        pd.DataFrame({"a": [1]}).to_excel(book, sheet_name="other")
    log = Log.read(path, known)
    assert_allclose(log.t, arrays["t"], rtol=1e-14)
    same(log, {k: v for k, v in arrays.items() if k != "t"})
    assert "only its sheet 'run' was read, not other" in log.notes
    assert "t from ms" in log.notes[-1]
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with rejected(r"needs the extra 'excel': in a checkout pip install '\.\["):
        Log.read(path, known)


def test_a_dictionary_of_arrays_is_a_log(arrays, known):
    fitted, held_out = (
        {k: v[part] for k, v in arrays.items()} for part in np.split(range(200), [120])
    )
    recordings = read_recordings([fitted], held_out, known)
    assert [len(x) for x in (*recordings.fitted, *recordings.held_out)] == [120, 80]
    assert "(in the robot's order)" in recordings.hints[0]


def test_a_format_of_ones_own_is_one_function(tmp_path, rejected):
    """It is read, refused and missed like those of the library."""

    @reader("lines of a logger", ".lines")
    def read_lines(path, known):
        if known.joints != ("shoulder",):
            raise ValueError(f"{known.joints} are not its joints")
        t, q, tau = np.loadtxt(path).T
        return pd.DataFrame({"t": t, "shoulder.q": q, "shoulder.tau": tau}), PLAIN, "5" * 64

    known = Conventions(joints=("shoulder",))
    path = tmp_path / "run.lines"
    try:
        rows = np.column_stack([np.arange(50) / 100, np.sin(np.arange(50)), np.arange(50.0)])
        np.savetxt(path, rows)
        log = Log.read(path, known)
        assert_allclose(np.column_stack([log.t, log.q, log.tau]), rows)
        assert (log.joints, log.sha256) == (("shoulder",), "5" * 64)
        with rejected(r"cannot be read as lines of a logger: .* are not its"):
            Log.read(path)
        for look in (check_there, Log.read):
            with rejected(r"There is no log file '.*other.lines'"):
                look(tmp_path / "other.lines")
    finally:
        READERS.pop()
