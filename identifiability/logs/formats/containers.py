"""Containers of arrays, and sheets: .mat, .npz and .xlsx, read at once into one table.

An array with one value for each sample is a column of its name. Column ``k`` of an (N, n) array is
``<name>[k]``, or ``<joint>.<name>`` if the file also holds the names of the joints.
"""

from __future__ import annotations

import warnings
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, ArrayByName, numbered
from identifiability.logs.form import PLAIN, Form, find_form
from identifiability.logs.names import check_names, guess_column

from .reader import TIMES, UNPACKED, Whole, check_unpacked, count_zipped, hash_files, reader

if TYPE_CHECKING:
    import pandas as pd

    from identifiability.logs.conventions import Conventions

#: Names of an array of the names of joints.
NAMES = ("joints", "joint_names", "names", "name")

#: How MATLAB's files since 7.3 begin.
_NEWER = b"MATLAB 7.3 MAT-file"

#: Bytes before the elements of older ones, the type of compressed elements, and bytes of a step.
_MAT_HEADER, _COMPRESSED, _STEP = 128, 15, 1 << 20

#: Orders of bytes, by the last two letters of the header.
_ORDERS: Mapping[bytes, Literal["little", "big"]] = {b"IM": "little", b"MI": "big"}

#: Bytes of XML that any workbook may have; and most cells, including empty ones, in addition to
#: those of its XML.
SHEETS, CELLS = 8_000_000, 200_000

#: Texts of cells that hold nothing, as pandas reads them, and errors of formulas.
EMPTY = frozenset(("", "NA", "N/A", "n/a", "nan", "NaN", "null", "NULL", "None", "<NA>"))
EMPTY |= {"#N/A", "#DIV/0!", "#NAME?", "#NULL!", "#NUM!", "#REF!", "#VALUE!"}


@reader("NumPy", ".npz")
def read_npz(path: Path, _: Conventions) -> Whole:
    """Return the arrays of an archive of NumPy's.

    Raises
    ------
    LogError
        If it holds no table.
    """
    check_unpacked(path, count_zipped(path))
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except ValueError as error:
        if "pickle" not in str(error):  # whose advice would be to load it all the same
            raise
        raise LogError(Finding("arrays.objects", path)) from None
    return frame_of(arrays, str(path)), PLAIN, hash_files(path)


@reader("MATLAB", ".mat")
def read_mat(path: Path, _: Conventions) -> Whole:
    """Return the variables of a MATLAB file.

    Raises
    ------
    LogError
        If it holds no table.
    """
    from scipy.io import loadmat  # noqa: PLC0415 - only who has such a file pays for it

    with path.open("rb") as file:
        newer = file.read(len(_NEWER)) == _NEWER
    if newer:
        raise LogError(Finding("arrays.matlab", path))
    check_unpacked(path, _count_matlab(path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on MATLAB objects, which hold no arrays
        arrays = loadmat(path, simplify_cells=True)
    return frame_of(arrays, str(path)), PLAIN, hash_files(path)


def _count_matlab(path: Path) -> int:
    """Return the unpacked size of compressed variables in bytes; counting stops above the limit.

    After a header of 128 bytes each element has its type and size (MATLAB's MAT-File Format).
    Older files, which do not compress, have another header.
    """
    found = 0
    most = max(UNPACKED, TIMES * path.stat().st_size)
    with path.open("rb") as file:
        mark = file.read(_MAT_HEADER)[-2:]
        order = _ORDERS.get(mark)
        while order and found <= most and len(tag := file.read(8)) == 8:
            kind, size = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))
            if kind != _COMPRESSED:
                file.seek(size, 1)
                continue
            found += _count_deflated(file.read(size), most - found)
    return found


def _count_deflated(content: bytes, most: int) -> int:
    """Return the unpacked size of a zlib stream in bytes; counting stops above a limit."""
    unpacking = zlib.decompressobj()
    found = 0
    while content and found <= most and not unpacking.eof:
        found += len(unpacking.decompress(content, _STEP))
        content = unpacking.unconsumed_tail
    return found


@reader("Excel", ".xlsx", ".xlsm")
def read_sheet(path: Path, _: Conventions) -> Whole:
    """Return the first sheet of a workbook that holds anything.

    Raises
    ------
    LogError
        If it holds no table.
    """
    filled = _read_sheets(path)
    if not filled:
        raise LogError(f"{path} has no sheet that holds anything.")
    name, sheet = next(iter(filled.items()))
    lines = sheet.map(lambda cell: " ".join(cell.split()) if isinstance(cell, str) else cell)
    text = lines.to_csv(
        index=False,
        header=False,
        lineterminator="\n",
    )
    form = find_form(text, "utf-8")
    data = sheet.iloc[form.lines :].reset_index(drop=True)
    rows = data.set_axis(list(form.columns), axis=1)
    others = [other for other in filled if other != name]
    notes = form.notes
    if others:
        notes = (*notes, f"only its sheet '{name}' was read, not {listing(others, 4)}")
    form = Form(
        columns=form.columns,
        units=form.units,
        notes=notes,
    )
    return rows.infer_objects(), form, hash_files(path)


def _read_sheets(path: Path) -> dict[str, pd.DataFrame]:
    """Return the cells of the sheets that hold anything, without empty rows and columns.

    Raises
    ------
    LogError
        If the workbook unpacks to far more than its size, or nothing reads workbooks.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    try:
        from openpyxl import load_workbook  # noqa: PLC0415 - an extra
    except ImportError:
        raise LogError(Finding("arrays.excel", path)) from None
    size = count_zipped(path)
    check_unpacked(path, size, SHEETS)
    left = CELLS + size // 4  # a filled cell takes more bytes
    found = {}
    book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
    try:
        for sheet in book.worksheets:
            rows, left = _read_cells(path, sheet, left)
            width = max(map(len, rows), default=0)
            filled_up = [[*row, *[None] * (width - len(row))] for row in rows]
            table = pd.DataFrame(filled_up, columns=range(width), dtype=object)
            table = table.dropna(how="all").dropna(axis=1, how="all")
            if not table.empty:
                found[str(sheet.title)] = table
    finally:
        book.close()
    return found


def _read_cells(path: Path, sheet: Any, most: int) -> tuple[list[list[object]], int]:
    """Return the rows of a sheet without empty cells at their ends, and the remaining allowance.

    A cell far to the right or far below implies millions of empty cells before it.

    Raises
    ------
    LogError
        If there are more cells than allowed.
    """
    sheet.reset_dimensions()
    rows = []
    width = 0
    left = most
    for row in sheet.iter_rows(values_only=True):
        left -= 1 + len(row)
        cells = [None if _is_empty(cell) else cell for cell in row]
        while cells and cells[-1] is None:
            cells.pop()
        rows.append(cells)
        width = max(width, len(cells))
        if left < 0 or width * len(rows) > most:  # short rows are filled up
            raise LogError(Finding("arrays.cells", path))
    return rows, left


def _is_empty(cell: object) -> bool:
    """Return whether a cell holds nothing, or the error of a formula."""
    return cell is None or (isinstance(cell, str) and cell.strip() in EMPTY)


def frame_of(arrays: Mapping[str, Any], source: str) -> pd.DataFrame:
    """Return arrays with one number of samples as a table.

    Parameters
    ----------
    arrays : mapping of str to array
        (N,) or (N, n); (n, N) if only that fits the others. Nested mappings are read, too.
    source : str
        Name of the arrays in messages.

    Raises
    ------
    LogError
        If there is no time, or no other array of its length.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    flat = _shortened(_flatten(arrays))
    check_names(source, [*flat])
    names = _joint_names(flat)
    numbers = {k: x for k, x in flat.items() if x.dtype.kind in "fiumM"}
    shaped = {k: np.atleast_1d(x.squeeze()) for k, x in numbers.items()}
    times = [k for k, x in shaped.items() if x.ndim == 1 and _is_time(k)]
    if not times:
        raise LogError(Finding("arrays.time", source, arrays=listing(sorted(flat)) or "none"))
    length = max(len(shaped[k]) for k in times)
    columns = {}
    lost = []
    for name, given in shaped.items():
        array = given
        if array.ndim == 2 and len(array) != length and array.shape[1] == length:
            array = array.T
        if array.ndim > 2 or len(array) != length:
            lost += [name] * (array.size > 1)  # a number, such as a rate, is no series
        elif array.ndim == 1:
            columns[name] = array
        elif len(names) == array.shape[1]:
            columns |= {f"{j}.{name}": array[:, k] for k, j in enumerate(names)}
        else:
            columns |= {f"{name}[{k}]": array[:, k] for k in range(array.shape[1])}
    kinds = {g.kind for k in columns if (g := guess_column(k, k, names))}
    if lost and not ("q" in kinds and kinds & {"tau", "current"}):
        shapes = [f"{k} {_shape(flat[k])}" for k in lost]
        raise LogError(
            Finding(
                "arrays.sizes",
                source,
                length=length,
                arrays=[*shapes],
            )
        )
    return pd.DataFrame(columns)


def stack_arrays(
    t: Any, channels: Mapping[str, Any], joints: Sequence[str] | None, source: str
) -> pd.DataFrame:
    """Return the arrays of a log, each (N, n), as a table.

    Parameters
    ----------
    t : (N,)
    channels : mapping of str to (N, n) or (N,)
    joints : sequence of str or None
        Which joint each column is about.
    source : str

    Raises
    ------
    LogError
        If they do not fit each other.
    """
    import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

    times = np.asarray(t, float)
    arrays = {kind: np.asarray(x, float) for kind, x in channels.items()}
    arrays = {kind: x[:, None] if x.ndim == 1 else x for kind, x in arrays.items()}
    shapes = {x.shape for x in arrays.values()}
    if times.ndim != 1 or shapes != {(len(times), *next(iter(shapes))[-1:])}:
        told = ", ".join(f"{kind} is {_shape(x)}" for kind, x in {"t": times, **arrays}.items())
        raise LogError(Finding("arrays.shapes", source, shapes=told))
    count = next(iter(shapes))[1]
    names = numbered(count) if joints is None else tuple(joints)
    if len(names) != count or len({*names}) < count:
        raise LogError(f"{source}: joints names {listing(names)}, which are not {count} joints.")
    columns = {f"{j}.{kind}": x[:, k] for kind, x in arrays.items() for k, j in enumerate(names)}
    return pd.DataFrame({"t": times, **columns})


def _shape(array: Array) -> str:
    return "×".join(map(str, array.shape)) or "a number"


def _is_time(name: str) -> bool:
    guess = guess_column(name, name, ())
    return guess is not None and guess.kind == "t"


def _flatten(arrays: Mapping[str, Any], above: str = "") -> dict[str, Array]:
    """Return all arrays by their names, those in mappings with the mapping's before them."""
    out: dict[str, Array] = {}
    for name, value in arrays.items():
        if isinstance(value, Mapping):
            out |= _flatten(value, f"{above}{name}.")
        elif not str(name).startswith("__"):
            out[f"{above}{name}"] = np.asarray(value)
    return out


def _shortened(arrays: ArrayByName) -> dict[str, Array]:
    """Return arrays by the last part of their names, if these parts are unique."""
    last = [name.rpartition(".")[2] for name in arrays]
    if len(set(last)) < len(last):
        return dict(arrays)
    return dict(zip(last, arrays.values(), strict=True))


def _joint_names(arrays: ArrayByName) -> list[str]:
    """Return the names of the joints, if an array holds them."""
    for key, array in arrays.items():
        if key.rpartition(".")[2].casefold() in NAMES and array.dtype.kind in "UO":
            texts = [str(x).strip() for x in np.ravel(array)]
            if texts and all(texts):
                return texts
    return []
