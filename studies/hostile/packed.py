"""Hostile logs: Parquet."""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hostile.case import NAMES, Hostile, Make, hostile, listed, no_files, spoilt


def parquets(good: pd.DataFrame) -> list[Hostile]:
    """Return hostile Parquet files."""
    import pyarrow as pa  # noqa: PLC0415
    import pyarrow.parquet as pq  # noqa: PLC0415

    def made(table: Any, **options: Any) -> Make:
        return lambda path: pq.write_table(table, path, **options)

    def of(**columns: Any) -> Any:
        return pa.table({**{c: good[c] for c in good}, **columns})

    size = len(good)

    def zeros(path: Path) -> None:
        names = ("t", "shoulder.q", "shoulder.tau")
        table = pa.table({c: pa.array(np.zeros(30_000_000)) for c in names})
        pq.write_table(table, path, compression="zstd")

    def long_text(path: Path) -> None:
        texts = ["a" * 500_000_000, *["b"] * (size - 1)]
        pq.write_table(of(x=texts), path, compression="zstd", use_dictionary=False)

    stream = io.BytesIO()
    good.to_parquet(stream)
    whole = stream.getvalue()
    tables: dict[str, Make | bytes] = {
        "30 million rows of zeros in few bytes": zeros,
        "a string of 500 MB in few bytes": long_text,
        "20,000 columns": made(of(**{f"x{k}": np.zeros(size) for k in range(20_000)})),
        "lists in lists": made(of(x=[[[[0.0] * 20] * 20]] * size)),
        "a column of bytes": made(of(x=[b"\0" * 1000] * size)),
        "positions that are texts": made(of(**{"elbow.q": ["=1+1"] * size})),
        "positions that are lists": made(of(**{"elbow.q": [[1.0, 2.0]] * size})),
        "positions that are whole and large": made(of(**{"elbow.q": [2**62] * size})),
        "times that are dates": made(of(t=pd.date_range("1677-09-22", periods=size, freq="D"))),
        "no rows": made(of().slice(0, 0)),
        "no columns": made(pa.table({})),
        "a name twice": made(pa.Table.from_arrays([of()[0]] * 2, ["t", "t"])),
        "pandas' words that are a lie": made(
            of().replace_schema_metadata({b"pandas": b'{"index_columns": ["x"], "columns": []}'})
        ),
        "pandas' words that are no JSON": made(
            of().replace_schema_metadata({b"pandas": b"{" * 50_000})
        ),
        "a schema of Arrow that is a lie": made(
            of().replace_schema_metadata({b"ARROW:schema": b"AAAA" * 99})
        ),
        "a footer of 4 GB": whole[:-8] + struct.pack("<I", 2**32 - 1) + b"PAR1",
        "a footer of a bit more than there is": whole[:-8]
        + struct.pack("<I", len(whole))
        + b"PAR1",
        "nothing but marks": b"PAR1PAR1",
        "encrypted": b"PARE" + whole[4:-4] + b"PARE",
    }
    names = {
        f"a column whose name is {name}": made(of(**{_safe(value): np.zeros(size)}))
        for name, value in NAMES.items()
    }
    return listed(
        [
            hostile("parquet", k, v, suffix=".parquet", kind="log")
            for k, v in (tables | names).items()
        ],
        no_files("parquet", ".parquet", "log"),
        spoilt("parquet", whole, ".parquet", 16, "log"),
    )


def _safe(text: str) -> str:
    return text.encode("utf-8", "replace").decode()
