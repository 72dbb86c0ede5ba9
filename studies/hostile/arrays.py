"""Hostile logs: arrays of NumPy and of MATLAB."""

from __future__ import annotations

import io
import pickle
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hostile.case import Hostile, Make, Runs, hostile, listed, no_files, spoilt


def arrays(good: pd.DataFrame) -> list[Hostile]:
    """Return hostile files of NumPy and of MATLAB."""
    from scipy.io import savemat  # noqa: PLC0415

    held = {"t": good["t"].to_numpy(), "q": good[["shoulder.q", "elbow.q"]].to_numpy(),
            "tau": good[["shoulder.tau", "elbow.tau"]].to_numpy()}  # fmt: skip
    stream, matlab = io.BytesIO(), io.BytesIO()
    np.savez(stream, **held)
    savemat(matlab, {"run": held})
    npz, mat = stream.getvalue(), matlab.getvalue()

    def zipped(parts: dict[str, bytes | int], method: int = zipfile.ZIP_DEFLATED) -> Make:
        """Pack parts; a number stands for so many zeros."""

        def make(path: Path) -> None:
            with zipfile.ZipFile(path, "w", method) as archive:
                for name, part in parts.items():
                    with archive.open(name, "w", force_zip64=True) as file:
                        if isinstance(part, bytes):
                            file.write(part)
                            continue
                        for _ in range(part // 1_000_000):
                            file.write(b"\0" * 1_000_000)

        return make

    def array(shape: str, kind: str = "<f8", more: bytes = b"") -> bytes:
        head = f"{{'descr': {kind if kind[0] == '[' else repr(kind)}, 'fortran_order': False, 'shape': {shape}, }}"
        head = head + " " * (63 - (len(head) + 10) % 64) + "\n"
        return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + more

    pickled = io.BytesIO()
    np.save(pickled, np.array([Runs()], object), allow_pickle=True)

    def bomb(path: Path) -> None:
        head = array("(250000000,)")
        with (
            zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open("t.npy", "w", force_zip64=True) as file,
        ):
            file.write(head)
            for _ in range(2000):
                file.write(b"\0" * 1_000_000)

    def saved(**values: Any) -> Make:
        return lambda path: np.savez(path, **values)

    times = held["t"]
    of_numpy: dict[str, Make | bytes] = {
        "2 GB of zeros": bomb,
        "an array that says it has 1e18 values": zipped({"t.npy": array("(10**18,)".replace("10**18", str(10**18)))}),
        "a shape below zero": zipped({"t.npy": array("(-5,)")}),
        "a shape of a million numbers": zipped({"t.npy": array("(" + "1," * 15_000 + ")")}),
        "a header that runs": zipped({"t.npy": array("__import__('os').system('touch canary')")}),
        "a header in brackets": zipped({"t.npy": array("(" * 30_000)}),
        "a pickled object": zipped({"t.npy": pickled.getvalue()}),
        "a pickle in its place": pickle.dumps(Runs()),
        "a pickle by the name of an array": zipped({"t.npy": pickle.dumps(Runs())}),
        "objects by kind": zipped({"t.npy": array("(5,)", "|O", b"\0" * 40)}),
        "a kind of a thousand fields": zipped({"t.npy": array("(1,)", str([(f"f{k}", "<f8") for k in range(1000)]))}),
        "100,000 arrays": zipped({f"a{k}.npy": array("()", more=b"\0" * 8) for k in range(100_000)}),
        "names above the folder": zipped({"../../evil.npy": array("()", more=b"\0" * 8)}),
        "a file that is no array": zipped({"t.txt": b"x", "q.npy": b"x"}),
        "an archive in an archive": zipped({"t.npy": npz}),
        "texts of 2 GB": zipped({"names.npy": array("(1,)", "<U500000000"), "t.npy": array("(5,)")}),
        "complex positions": saved(**(held | {"q": held["q"] * 1j})),
        "positions of six dimensions": saved(**(held | {"q": held["q"][None, None, None, None]})),
        "times that are texts": saved(**(held | {"t": times.astype(str)})),
        "times that are dates": saved(**(held | {"t": times.astype("M8[ns]")})),
        "nothing": saved(),
        "arrays of nothing": saved(t=np.zeros(0), q=np.zeros((0, 2)), tau=np.zeros((0, 2))),
        "100,000 joints": saved(t=times[:30], q=np.zeros((30, 100_000)), tau=np.zeros((30, 100_000))),
        "joints that are formulas": saved(**held, joints=np.array(["=1+1", "@x"])),
        "joints of escapes": saved(**held, joints=np.array(["\x1b[2J", "\x9b2J"])),
    }  # fmt: skip

    def zeros(path: Path) -> None:
        large = {"t": np.zeros(250_000_000, np.int8), "q": np.zeros((125_000_000, 2), np.int8)}
        savemat(path, large, do_compression=True)

    def matlabs(**values: Any) -> Make:
        return lambda path: savemat(path, values, do_compression=True)

    deep: dict[str, Any] = {}
    inner = deep
    for _ in range(60):
        inner["a"] = {}
        inner = inner["a"]
    of_matlab: dict[str, Make | bytes] = {
        "500 MB of zeros": zeros,
        "structures in each other": matlabs(t=times, x=deep),
        "a cell of cells": matlabs(t=times, x=np.array([[np.zeros(3)] * 3] * 3, object)),
        "10,000 variables": matlabs(**{f"a{k}": 1 for k in range(10_000)}),
        "version 7.3": b"MATLAB 7.3 MAT-file" + b"\0" * 600 + b"\x89HDF\r\n\x1a\n",
        "version 4 that says it has 1e9 rows": struct.pack("<5i", 0, 10**9, 2, 0, 2) + b"t\0",
        "an element of 4 GB": mat[:132] + struct.pack("<I", 2**32 - 1) + mat[136:],
        "a function of MATLAB": mat[:128] + struct.pack("<2I", 14, 64) + struct.pack("<4I", 6, 8, 16, 0) + mat[152:],
        "an object of MATLAB": mat[:144] + bytes([3]) + mat[145:],
        "only its head": mat[:128],
        "text": b"just text",
        "joints that are formulas": matlabs(**held, joints=np.array(["=1+1", "@x"], object)),
        "a sparse matrix": matlabs(t=times, q=__import__("scipy.sparse").sparse.eye(400)),
    }  # fmt: skip
    return listed(
        [hostile("npz", k, v, suffix=".npz", kind="log") for k, v in of_numpy.items()],
        [hostile("mat", k, v, suffix=".mat", kind="log") for k, v in of_matlab.items()],
        no_files("npz", ".npz", "log"),
        spoilt("npz", npz, ".npz", 8, "log"),
        spoilt("mat", mat, ".mat", 10, "log"),
    )
