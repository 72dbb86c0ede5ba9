"""Does any spoilt file give a traceback, a hang or a crash instead of one sentence?

Every reader is thrown spoilt files by ``tests/bad_input/fuzz.py``, each reader in a process of its
own, so that a crash of a parser is counted and does not end the study.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from identifiability.foundation.output import write_json
from identifiability.report import Check, Fold, Note, Notes, Prose, Section, frame_table, write_page

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]
FUZZER = ROOT / "tests" / "bad_input" / "fuzz.py"

#: What must hold: different inputs a reader, and seconds for the slowest of them.
ASKED, SLOWEST = 10_000, 5.0

#: Up to a third of what hypothesis draws it has drawn before.
DRAWN = 16_000

#: What the readers read.
FILES = {
    "bag": "ROS bag (MCAP)",
    "csv": "log, CSV",
    "parquet": "log, Parquet",
    "npz": "log, .npz",
    "mat": "log, MATLAB",
    "ladder": "ladder, TOML",
    "sidecar": "sidecar, TOML",
    "result": "result, JSON",
    "trajectories": "trajectories, JSON",
    "mjcf": "robot, MJCF",
    "urdf": "robot, URDF",
}

Row = dict[str, Any]


def measure(reader: str, examples: int) -> Row:
    """Return what came of many spoilt files of one reader."""
    words = [sys.executable, FUZZER, "--examples", str(examples), "--reader", reader, "--all"]
    done = subprocess.run(words, check=False, capture_output=True, text=True)
    place, _, line = done.stdout.partition("\n")
    if done.returncode == 0:
        return json.loads(line) | {"crash": "", "printed": done.stderr[-500:]}
    # A hang ends the process too: faulthandler prints where it was.
    words_of_it = " ".join(done.stderr.split())[-500:]
    return {"reader": reader, "crash": words_of_it or f"exit {done.returncode}", "kept in": place}


def list_readers() -> list[str]:
    """Return the names of the readers that are installed."""
    words = [sys.executable, FUZZER, "--list"]
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()


def good(row: Row) -> bool:
    """Whether a reader gave nothing but answers and sentences, in time and in print."""
    return not row["crash"] and not row["other"] and not row["printed"] and row["slowest"] < SLOWEST


def frame(rows: Sequence[Row], asked: int) -> pd.DataFrame:
    """Return one row a reader."""
    out = []
    for r in rows:
        told = {"reader": FILES[r["reader"]]}
        if r["crash"]:
            out.append(told | {"anything else": Check("crash or hang", False, "never")})
            continue
        out.append(
            told
            | {
                "inputs": r["inputs"],
                "different": Check(str(r["distinct"]), r["distinct"] >= asked, f"at least {asked}"),
                "accepted": r["accepted"],
                "refused": r["refused"],
                "sentences": r["reasons"],
                "anything else": Check(str(r["other"]), r["other"] == 0, "never"),
                "slowest [ms]": Check(
                    f"{1e3 * r['slowest']:.0f}", r["slowest"] < SLOWEST, f"under {SLOWEST:g} s"
                ),
            }
        )
    return pd.DataFrame(out)


def state(rows: Sequence[Row]) -> str:
    """Return the answer in plain words."""
    inputs = sum(r.get("inputs", 0) for r in rows)
    refused = sum(r.get("refused", 0) for r in rows)
    bad = [FILES[r["reader"]] for r in rows if not good(r)]
    text = (
        f"Of {inputs} spoilt files for {len(rows)} readers {refused} were refused with one "
        f"sentence and {sum(r.get('accepted', 0) for r in rows)} could still be read."
    )
    if bad:
        return f"{text} Something else came of: {', '.join(bad)}."
    slow = max(rows, key=lambda r: r["slowest"])
    return (
        f"{text} There was no traceback, no crash and no hang; the slowest took "
        f"{1e3 * slow['slowest']:.0f} ms ({FILES[slow['reader']]})."
    )


def write(rows: Sequence[Row], examples: int, out: Path) -> None:
    """Write the page and the numbers, and print where."""
    text = state(rows)
    lead = (
        "Accepted: what was spoilt did not matter, or gave another file that is valid. Refused: "
        "one sentence on one line, of the library's own error types. Sentences: how many, without "
        "the names and numbers that they quote."
    )
    method = (
        "A good file is cut, copied and overwritten at up to four places by bytes and words of "
        "its format. Documents and markup are also rebuilt with values lost, renamed, swapped or "
        "of another type; tables with columns and cells of other types, other separators, decimal "
        "signs and encodings; bags with messages of other joints, times and lengths. Inputs are "
        "drawn by hypothesis and the same in every run. Logs are read and prepared for the "
        "regression; motions are closed and simulated; ladders are built on the robot."
    )
    longest = [
        Note("note", FILES[r["reader"]], r["longest_sentence"]) for r in rows if not r["crash"]
    ]
    found = [
        Note("warning", FILES[r["reader"]], r["crash"] or r["worst"] or r["printed"])
        for r in rows
        if not good(r)
    ]
    table = frame_table(frame(rows, examples * ASKED // DRAWN))
    blocks = (table, *([Notes(tuple(found))] if found else []))
    sections = (
        Section("readers", "Readers", lead, blocks),
        Section(
            "method", "Method", "",
            (Prose((method,)), Fold("The longest sentence of each", (Notes(tuple(longest)),))),
        ),
    )  # fmt: skip
    out.parent.mkdir(parents=True, exist_ok=True)
    data = {"schema": "identifiability/study/fuzz_readers/1", "statement": text}
    print(text)
    print(write_json(out, data | {"examples": examples, "readers": list(rows)}))
    page = out.with_suffix(".html")
    subtitle = f"{examples} inputs a reader"
    print(
        write_page(
            "What do spoilt files do?", text, sections, page, overline="Study", subtitle=subtitle
        )
    )


def main(argv: Sequence[str] | None = None) -> list[Row]:
    """Run the study."""
    parser = argparse.ArgumentParser(
        prog="fuzz_readers", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "fuzz_readers.json")
    parser.add_argument("--quick", action="store_true", help="400 inputs a reader")
    parser.add_argument("--examples", type=int, default=DRAWN)
    given = parser.parse_args(argv)
    examples = 400 if given.quick else given.examples
    rows = []
    for reader in list_readers():
        rows.append(measure(reader, examples))
        told = {k: v for k, v in rows[-1].items() if k in ("inputs", "other", "crash", "slowest")}
        sys.stderr.write(f"{reader}: {told}\n")
    write(rows, examples, given.out)
    return rows


if __name__ == "__main__":
    main()
