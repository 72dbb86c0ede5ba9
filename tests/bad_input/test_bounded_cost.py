"""Small files that stand for very much are refused with one sentence, at a bounded cost."""

import json
import re
import shutil
import subprocess
import sys
import zipfile
import zlib
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from identifiability import Log
from identifiability.logs.formats.reader import check_unpacked

DATASETS = Path(__file__).parents[1] / "interchange/lerobot"

#: Memory [MB] and processor time [s] of a refusal, start and imports included, with a margin.
MEMORY, TIME = 500, 10

#: Zeros that are compressed again and again [bytes].
MEGABYTE = bytes(1_000_000)

READ = """
import resource, sys
from pathlib import Path
from identifiability import Robot
from identifiability import IdentifiabilityError
from identifiability.logs.conventions import Conventions
from identifiability.quality.recordings import read_recordings
known = Conventions.of(Robot.load("two-link"))
try:
    read_recordings(sys.argv[1], (), known)
except IdentifiabilityError as refusal:
    print(refusal)
used = resource.getrusage(resource.RUSAGE_SELF)
status = Path("/proc/self/status")  # elsewhere the parent's memory may count
lines = status.read_text().splitlines() if status.exists() else []
peak = [int(line.split()[1]) for line in lines if line.startswith("VmHWM")]
print((*peak, used.ru_maxrss)[0] // 1000, used.ru_utime + used.ru_stime)
"""


def refusal(path):
    """Return the sentence with which another process refuses a file within the bounds."""
    command = [sys.executable, "-c", READ, str(path)]
    out = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    *said, used = out.stdout.strip().splitlines()
    memory, time = map(float, used.split())
    assert len(said) == 1, said
    assert memory < MEMORY
    assert time < TIME
    return said[0]


def workbook(path, sheet):
    """Write a workbook whose first sheet has this XML."""
    pytest.importorskip("openpyxl")
    plain = path.with_name("plain.xlsx")
    pd.DataFrame({"t": [0.0]}).to_excel(plain, index=False)
    space = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    begin = f'<worksheet xmlns="{space}"><sheetData>'
    end = "</sheetData></worksheet>"
    with zipfile.ZipFile(plain) as given, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name in given.namelist():
            is_sheet = name == "xl/worksheets/sheet1.xml"
            out.writestr(name, f"{begin}{sheet}{end}" if is_sheet else given.read(name))


def rows_of_cells(path):
    workbook(path, "<row><c><v>1</v></c><c><v>1</v></c></row>" * 1_500_000)


def cell_far_below(path):
    workbook(path, '<row r="1"><c><v>1</v></c></row><row r="1000000000"><c><v>1</v></c></row>')


def cells_far_right(path):
    rows = (f'<row r="{k}"><c r="XFD{k}"><v>1</v></c></row>' for k in range(1, 60_001))
    workbook(path, "".join(rows))


def zeros_in_npz(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name in ("t", "q", "tau"):
            with out.open(f"{name}.npy", "w") as file:
                shape = {"descr": "<f8", "fortran_order": False, "shape": (30_000_000,)}
                np.lib.format.write_array_header_1_0(file, shape)
                for _ in range(240):
                    file.write(MEGABYTE)


def zeros_in_mat(path):
    plain = BytesIO()
    savemat(plain, {"t": np.arange(4.0)})
    packing = zlib.compressobj()
    size = 600_000_000
    numbers = [14, size + 56, 6, 8, 6, 0, 5, 8, size // 8, 1, 0x10001, ord("t"), 9, size]
    parts = [packing.compress(np.array(numbers, "<u4").tobytes())]
    parts += [packing.compress(MEGABYTE) for _ in range(size // 1_000_000)]
    content = b"".join([*parts, packing.flush()])
    tag = np.array([15, len(content)], "<u4").tobytes()
    path.write_bytes(plain.getvalue()[:128] + tag + content)


def runs_in_parquet(path):
    table = pa.table({c: np.zeros(1_000_000) for c in ("t", "elbow.q", "elbow.tau")})
    with pq.ParquetWriter(path, table.schema, compression="zstd") as file:
        for _ in range(100):
            file.write_table(table)


def long_text_in_every_row(path):
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(100_000, "i4")), ["x" * 1_000_000])
    pq.write_table(pa.table({"t": np.arange(1e5), "joint": text}), path, compression="zstd")


def long_lists_in_parquet(path):
    ends = pa.array(np.arange(101, dtype="i4") * 400_000)
    lists = pa.ListArray.from_arrays(ends, pa.array(np.zeros(40_000_000)))
    pq.write_table(pa.table({"t": np.arange(100.0), "q": lists}), path, compression="zstd")


def long_name_in_csv(path):
    path.write_text(f"t,{'x' * 20_000_000},y\n" + "0,1,2\n" * 50)


def brackets_in_csv(path):
    path.write_text(f"t,{'(' * 200_000},y\n" + "0,1,2\n" * 50)


def long_name_in_parquet(path):
    pd.DataFrame({"t": np.arange(50.0), "elbow " * 200_000: 0.0}).to_parquet(path)


def many_columns(path):
    pd.DataFrame(np.zeros((30, 25_000))).add_prefix("elbow_pos").to_parquet(path)


def chunks_in_mcap(path):
    pytest.importorskip("rosbags", reason="needs the extra 'ros'")
    size = (4_000_000_000).to_bytes(8, "little")
    chunk = bytes(16) + size + bytes(4) + (4).to_bytes(4, "little") + b"zstd" + bytes(8)
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x06" + len(chunk).to_bytes(8, "little") + chunk)


def chunks_in_bag(path):
    pytest.importorskip("rosbags", reason="needs the extra 'ros'")
    fields = [b"op=\x05", b"compression=bz2", b"size=\xff\xff\xff\xf0"]
    header = b"".join(len(f).to_bytes(4, "little") + f for f in fields)
    content = len(header).to_bytes(4, "little") + header + (8).to_bytes(4, "little") + bytes(8)
    path.write_bytes(b"#ROSBAG V2.0\n" + content)


UNPACKS = r"has .* MB and unpacks to .* MB or more, over 100 times its size"
LONG_NAME = r"has a column whose name has \d+ letters"

FILES = {
    "rows.xlsx": (rows_of_cells, UNPACKS),
    "below.xlsx": (cell_far_below, "empty rows or columns beyond all bounds"),
    "right.xlsx": (cells_far_right, "empty rows or columns beyond all bounds"),
    "zeros.npz": (zeros_in_npz, UNPACKS),
    "zeros.mat": (zeros_in_mat, UNPACKS),
    "runs.parquet": (runs_in_parquet, UNPACKS),
    "text.parquet": (long_text_in_every_row, r"has no column shoulder\.q"),
    "lists.parquet": (long_lists_in_parquet, UNPACKS),
    "name.csv": (long_name_in_csv, LONG_NAME),
    "brackets.csv": (brackets_in_csv, LONG_NAME),
    "name.parquet": (long_name_in_parquet, LONG_NAME),
    "columns.parquet": (many_columns, "has 25000 columns, and tables of up to 20000 are read"),
    "chunks.mcap": (chunks_in_mcap, UNPACKS),
    "chunks.bag": (chunks_in_bag, UNPACKS),
}


@pytest.mark.parametrize("name", FILES)
def test_a_small_file_that_stands_for_very_much_is_refused_at_a_bounded_cost(name, tmp_path):
    make, sentence = FILES[name]
    path = tmp_path / name
    make(path)
    assert path.stat().st_size < 22_000_000
    said = refusal(path)
    assert name in said
    assert re.search(sentence, said)


@pytest.mark.parametrize("version, given", [("v2.1", ""), ("v3.0", ":0-999999998")])
def test_a_dataset_that_counts_episodes_it_does_not_hold_is_refused(version, given, tmp_path):
    shutil.copytree(DATASETS / version, tmp_path / "set")
    path = tmp_path / "set/meta" / "info.json"
    info = json.loads(path.read_text())
    path.write_text(json.dumps({**info, "total_episodes": 10**9}))
    said = refusal(f"{tmp_path / 'set'}{given}")
    assert "counts 1000000000 episodes, and the folder 'data' holds at most" in said
    assert "has no row of episode" in refusal(f"{tmp_path / 'set'}:999999")


def test_files_that_compress_well_are_read(tmp_path):
    t = np.arange(20_000) * 0.01
    wave = np.sin(t)
    columns = {f"{j}.{kind}": 0.0 * t for j in ("shoulder", "elbow") for kind in ("q", "tau")}
    frame = pd.DataFrame({"t": t, **columns, "elbow.q": wave})
    np.savez_compressed(tmp_path / "log.npz", **{c: frame[c] for c in frame})
    frame.to_parquet(tmp_path / "log.parquet", compression="zstd")
    for name in ("log.npz", "log.parquet"):
        assert (Log.read(tmp_path / name).q[:, 1] == wave).all()


def test_what_a_file_may_unpack_to_grows_with_its_size(tmp_path, rejected):
    path = tmp_path / "log.npz"
    path.write_bytes(bytes(1_000_000))
    check_unpacked(path, 100_000_000)
    with rejected("has 1 MB and unpacks to 101 MB or more"):
        check_unpacked(path, 101_000_000)
