"""Foreign text, containers and column names."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import savemat

from foreign.case import Case, Writer, csv, joints, text


def same(x: Any) -> Any:
    return x


def renamed(rule: Callable[[str], str]) -> Writer:
    """Return a writer of a log with renamed columns."""
    return csv(lambda f, _: f.set_axis([rule(c) for c in f.columns], axis=1))


def stored(name: str, write: Callable[[pd.DataFrame, Path], Any]) -> Writer:
    """Return a writer of a file of another kind."""

    def make(frame: pd.DataFrame, folder: Path, _: np.random.Generator) -> Path:
        path = folder / name
        write(frame, path)
        return path

    return make


def arrays(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    """Return a log as arrays by channel, as logging scripts keep them."""
    names = joints(frame)
    whole = {k: frame[[f"{j}.{k}" for j in names]].to_numpy() for k in ("q", "tau")}
    return {"t": frame["t"].to_numpy(), **whole}


def columns(frame: pd.DataFrame) -> dict[str, np.ndarray]:
    return {c: frame[c].to_numpy() for c in frame.columns}


def second_line(line: str) -> Callable[[str], str]:
    """Return a function that inserts a line below the header."""
    return lambda s: s.replace("\n", f"\n{line}\n", 1)


def with_units(frame: pd.DataFrame) -> list[str]:
    return ["s" if c == "t" else "rad" if c.endswith("q") else "N.m" for c in frame.columns]


def unit_row(s: str) -> str:
    header, rest = s.split("\n", 1)
    units = ["s" if c == "t" else "rad" if c.endswith(".q") else "Nm" for c in header.split(",")]
    return "\n".join([header, ",".join(units), rest])


def repeated_header(s: str) -> str:
    lines = s.splitlines()
    half = len(lines) // 2
    return "\n".join([*lines[:half], lines[0], *lines[half:]]) + "\n"


NUMBERED = {"t": "time"}

TEXT = [
    Case("semicolons", "text", text(same, sep=";"), ("separated by",)),
    Case("tabs", "text", text(same, sep="\t"), ("separated by",)),
    Case("blanks between columns", "text", text(same, sep=" "), ("separated by",)),
    Case(
        "semicolons and decimal commas", "text", text(same, sep=";", decimal=","), ("separated by",)
    ),
    Case("tabs and decimal commas", "text", text(same, sep="\t", decimal=","), ("separated by",)),
    Case("UTF-16", "text", text(same, "utf-16")),
    Case("UTF-8 with a mark", "text", text(same, "utf-8-sig")),
    Case("a comment in Latin-1", "text", text(lambda s: "# Messung bei 20 °C\n" + s, "latin-1")),
    Case("comment lines with #", "text", text(lambda s: "# robot A\n# run 7\n" + s)),
    Case("comment lines with %", "text", text(lambda s: "% robot A\n% run 7\n" + s)),
    Case("a row of units", "text", text(unit_row)),
    Case("Windows line ends", "text", text(lambda s: s.replace("\n", "\r\n"))),
    Case("old Mac line ends", "text", text(lambda s: s.replace("\n", "\r"))),
    Case(
        "quoted header",
        "text",
        text(
            lambda s: (
                ",".join(f'"{c}"' for c in s.split("\n", 1)[0].split(","))
                + "\n"
                + s.split("\n", 1)[1]
            )
        ),
    ),
    Case("a separator at each line's end", "text", text(lambda s: s.replace("\n", ",\n"))),
    Case("empty lines at the end", "text", text(lambda s: s + "\n\n\n")),
    Case(
        "cut in a number",
        "text",
        text(lambda s: s[: s.rindex(",") + 4]),
        ("cut", "incomplete", "ends", "last row", "line end"),
    ),
    Case(
        "cut in a row",
        "text",
        text(lambda s: s[: s.rindex("\n", 0, -1) + 40]),
        ("cut", "incomplete", "ends", "last row", "columns"),
    ),
    Case("the header comes again", "text", text(repeated_header), ("data row", "header")),
    Case("an empty file", "text", text(lambda s: ""), ("empty",)),
    Case(
        "a header and no rows",
        "text",
        text(lambda s: s.split("\n", 1)[0] + "\n"),
        ("no rows", "0 samples", "empty"),
    ),
    Case(
        "a web page",
        "text",
        text(lambda s: "<!DOCTYPE html>\n<html><body>Sign in</body></html>\n"),
        ("t'", "HTML", "web page", "column"),
    ),
    Case("the numbering of a DataFrame", "text", csv(lambda f, _: f, index=True)),
]

CONTAINERS = [
    Case("Parquet", "container", stored("log.parquet", lambda f, p: f.to_parquet(p)), quiet=True),
    Case(
        "CSV in gzip",
        "container",
        stored(
            "log.csv.gz", lambda f, p: p.write_bytes(gzip.compress(f.to_csv(index=False).encode()))
        ),
        ("compressed",),
    ),
    Case(
        "MATLAB: a variable a column",
        "container",
        stored(
            "log.mat",
            lambda f, p: savemat(p, {c.replace(".", "_"): x for c, x in columns(f).items()}),
        ),
    ),
    Case("MATLAB: arrays", "container", stored("log.mat", lambda f, p: savemat(p, arrays(f))), ()),
    Case(
        "NumPy: arrays", "container", stored("log.npz", lambda f, p: np.savez(p, **arrays(f))), ()
    ),
    Case(
        "NumPy: an array a column",
        "container",
        stored("log.npz", lambda f, p: np.savez(p, **columns(f))),
    ),
    Case(
        "NumPy: one array without names",
        "container",
        stored("log.npy", lambda f, p: np.save(p, f.to_numpy())),
        (".npz", "names", ".npy"),
    ),
    Case("a spreadsheet", "container", stored("log.xlsx", lambda f, p: f.to_excel(p, index=False))),
    Case(
        "JSON", "container", stored("log.json", lambda f, p: f.to_json(p)), ("JSON", "json", "CSV")
    ),
    Case(
        "a pickle",
        "container",
        stored("log.pkl", lambda f, p: f.to_pickle(p)),
        ("pickle", "pkl", "binary", "CSV"),
    ),
]

NAMES = [
    Case(
        "other joint names, mapped",
        "names",
        renamed(lambda c: c.replace("joint_", "fer_joint")),
        columns={r"fer_joint(\d)": r"joint_\1"},
    ),
    Case(
        "other joint names",
        "names",
        renamed(lambda c: c.replace("joint_", "fer_joint")),
        ("--map", "[columns]", "joint_1"),
    ),
    Case(
        "a gripper beside",
        "names",
        csv(lambda f, _: f.assign(**{"finger.q": 0.02, "finger.tau": 0.0})),
        (),
    ),
    Case(
        "temperatures beside", "names", csv(lambda f, _: f.assign(temperature=25.0, mode="run")), ()
    ),
    Case(
        "position and effort",
        "names",
        renamed(lambda c: c.replace(".q", ".position").replace(".tau", ".effort")),
        ("did you mean", "--map", "[columns]"),
    ),
    Case(
        "joint_1_q",
        "names",
        renamed(lambda c: c.replace(".", "_")),
        ("did you mean", "--map", "[columns]"),
    ),
    Case(
        "q1 and tau1",
        "names",
        renamed(lambda c: c if c == "t" else "".join(c.removeprefix("joint_").split(".")[::-1])),
        ("did you mean", "--map", "[columns]"),
    ),
    Case(
        "q[0] and tau[0]",
        "names",
        renamed(lambda c: c if c == "t" else f"{c[8:]}[{int(c[6]) - 1}]"),
        ("--map", "[columns]", "did you mean"),
    ),
    Case(
        "time",
        "names",
        renamed(lambda c: NUMBERED.get(c, c)),
        ("did you mean", "--map", "[columns]"),
    ),
    Case(
        "units in the header",
        "names",
        renamed(
            lambda c: f"{c} [s]" if c == "t" else f"{c} [rad]" if c.endswith("q") else f"{c} [Nm]"
        ),
        ("did you mean", "--map", "[columns]"),
    ),
    Case("capitals", "names", renamed(str.upper), ("--map", "[columns]", "'t'", "did you mean")),
    Case("blanks around names", "names", renamed(lambda c: f" {c} "), ()),
    Case("another order", "names", csv(lambda f, _: f[f.columns[::-1]]), quiet=True),
    Case(
        "a torque column is missing",
        "names",
        csv(lambda f, _: f.drop(columns="joint_3.tau")),
        ("joint_3.tau",),
    ),
    Case(
        "a joint is missing",
        "names",
        csv(lambda f, _: f.drop(columns=["joint_6.q", "joint_6.tau"])),
        ("joint_6",),
    ),
    Case(
        "a column is there twice",
        "names",
        csv(lambda f, _: pd.concat([f, f[["joint_1.q"]]], axis=1)),
        ("more than once", "twice"),
    ),
    Case(
        "a misspelt column",
        "names",
        renamed(lambda c: c.replace("joint_2.tau", "joint_2.tua")),
        ("joint_2.tau",),
    ),
    Case("time as the index", "names", csv(lambda f, _: f.set_index("t"), index=True)),
]
