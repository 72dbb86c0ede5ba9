"""Hostile logs: tables of text, and names of files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd

from hostile.case import (
    NAMES,
    NUMBERS,
    Hostile,
    Make,
    encoded,
    hostile,
    listed,
    no_files,
    sparse,
    spoilt,
)

_COLUMNS = "t,shoulder.q,elbow.q,shoulder.tau,elbow.tau"
_ROW = "0.0,0.1,0.2,0.3,0.4\n"


def csvs(good: pd.DataFrame) -> list[Hostile]:
    """Return hostile tables of text."""
    text = good.to_csv(index=False)
    head, _, rows = text.partition("\n")
    wide = ",".join([_COLUMNS, *(f"x{k}" for k in range(1_000_000))])
    texts: dict[str, str | bytes | Make] = {
        "zeros without a line end, 180 MB": sparse(b"t,q,", 180_000_000),
        "a header without a line end, 150 MB": sparse(b"t,", 150_000_000, b"abcdefg,x,"),
        "a line without end, 150 MB": sparse(f"{_COLUMNS}\n{_ROW}".encode(), 150_000_000, b"1,"),
        "a field without end, 150 MB": sparse(f"{_COLUMNS}\n{_ROW}".encode(), 150_000_000, b"1"),
        "a quote without end, 150 MB": sparse(f'{_COLUMNS}\n{_ROW}"'.encode(), 150_000_000, b"a\n"),
        "a quote in the header, 150 MB": sparse(b't,"', 150_000_000, b"a\n"),
        "empty lines, 100 MB": sparse(b"", 100_000_000, b"\n"),
        "empty lines under a header, 100 MB": sparse(f"{_COLUMNS}\n".encode(), 100_000_000, b"\n"),
        "comments, 100 MB": sparse(b"", 100_000_000, b"# a\n"),
        "blanks, 100 MB": sparse(f"{_COLUMNS}\n{_ROW}".encode(), 100_000_000, b" "),
        "returns, 100 MB": sparse(f"{_COLUMNS}\n{_ROW}".encode(), 100_000_000, b"\r"),
        "a million columns": f"{wide}\n" + "0," * 1_000_004 + "0\n",
        "100,000 columns, 30 rows": ",".join([_COLUMNS, *(f"x{k}" for k in range(100_000))]) + "\n"
        + ("0," * 100_004 + "0\n") * 30,
        "a million columns of one name": "t" + ",t" * 1_000_000 + "\n" + "0," * 1_000_000 + "0\n",
        "2,000 joints": ",".join(["t", *(f"j{k}.{c}" for k in range(2000) for c in ("q", "tau"))])
        + "\n" + ("0," * 4000 + "0\n") * 40,
        "a name of a million letters": f"t,{'x' * 1_000_000}.q,elbow.q,shoulder.tau,elbow.tau\n" + _ROW * 30,
        "a name that looks for a rule without end": f"t,{'left' * 20}.q,elbow.q,shoulder.tau,elbow.tau\n" + _ROW * 30,
        "rows longer than the header": f"{_COLUMNS}\n" + f"{_ROW[:-1]},1,2,3\n" * 30,
        "rows of all lengths": f"{_COLUMNS}\n" + "".join("0," * (k % 9) + "0\n" for k in range(900)),
        "a number of a million digits": f"{_COLUMNS}\n" + _ROW * 30 + "9" * 1_000_000 + ",0,0,0,0\n",
        "a name of a column that is a number": "0,1,2,3,4\n" + _ROW * 30,
        "nothing but a header": _COLUMNS + "\n",
        "nothing but commas": "," * 100_000 + "\n" + "," * 100_000 + "\n",
        "nothing but quotes": '"' * 1_000_001,
        "one line": _COLUMNS,
        "times that stand still": f"{_COLUMNS}\n" + _ROW * 500,
        "times backwards": head + "\n" + "\n".join(rows.splitlines()[::-1]) + "\n",
        "times of 1e300": text.replace("\n0.", "\n1e300", 1),
        "two tables in each other": text + text,
        "a web page": "<html><body>" + "<td>0</td>" * 50_000,
        "a program": Path("/bin/sh").read_bytes()[:120_000],
        "a Parquet file by name": b"PAR1" + b"\0" * 10_000 + b"PAR1",
        "an archive by name": b"PK\x03\x04" + b"\0" * 10_000,
        "decimal commas of another land": text.replace(",", ";").replace(".", ","),
        "line ends of three kinds": text.replace("\n", "\r\n", 50).replace("\r\n", "\r", 20),
        "vertical tabs and other ends of lines": text.replace("\n", "\x0b\n", 5).replace("\n", "\u2028\n", 9),
    }  # fmt: skip
    cells = {f"a value of {number[:12]!r}": text.replace("\n", f"\n{number},0,0,0,0\n", 3)
             for number in NUMBERS}  # fmt: skip
    named = {
        f"a column whose name is {name}": text.replace("elbow.q,", f"{_field(value)}.q,", 1)
        for name, value in NAMES.items()
    }
    cell = {
        f"a cell that is {name}": text.replace("\n", f"\n{_field(value)},0,0,0,0\n", 2)
        for name, value in NAMES.items()
    }
    return listed(
        [hostile("csv", k, v, suffix=".csv", kind="log") for k, v in (texts | cells | named | cell).items()],
        encoded("csv", text, ".csv", "log"),
        no_files("csv", ".csv", "log"),
        spoilt("csv", text.encode(), ".csv", 8, "log"),
    )  # fmt: skip


def _field(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def file_names(good: pd.DataFrame) -> list[Hostile]:
    """Return good tables whose file has a name that a shell, a terminal or a parser would obey."""
    text = good.to_csv(index=False)
    names = (
        "--report", "-rf.csv", "a\nError: b.csv", "\x1b[2J.csv", "\x9b2J.csv", "a\u202evsc.csv", "%s%n.csv",
        "$(touch canary).csv", "`touch canary`.csv", "=1+1.csv", "a;touch canary.csv", "[red]a.csv",
        "con.csv", "a:b.csv", "x" * 250 + ".csv", "\udcff.csv", " .csv", "~.csv", "{0.__class__}.csv", "..csv",
    )  # fmt: skip
    out = [hostile("name", f"{name[:40]!r}", text, file=name, kind="log") for name in names]
    return [
        replace(case, words=tuple("--" if w == "--engine" else w for w in case.words if w != "serial"))
        if case.file.startswith("--") else case
        for case in out
    ]  # fmt: skip
