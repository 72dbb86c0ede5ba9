"""Does any hostile file, or any fault while a command works, do harm?

Every reader is given files that nobody means well with, each in a process of its own under limits:
one sentence or a right answer within seconds and a gigabyte, nothing run, fetched or written
elsewhere, nothing on the terminal that it would obey. Commands are then hit while they work: by
signals from the first millisecond on, lost workers, full disks, folders that vanish, spoilt results
of finished work; after that they must end with the bits of a run that nobody disturbed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from hostile import arrays, bags, csv_text, documents, judge, mjcf, packed, sheets, urdf
from hostile.case import Hostile
from hostile.clusters import ClusterDays
from hostile.disks import DiskDays
from hostile.faults import Fault
from hostile.judge import CPU, MEMORY, Outcome

from identifiability.foundation.output import write_json
from identifiability.report import Check, Note, Notes, Prose, Section, frame_table, write_page

ROOT = Path(__file__).resolve().parents[1]

#: Kind of fault, command, and how many.
FAULTS = (
    ("kills", "analyze", 36), ("kills", "prune", 36), ("kills", "excite", 30),
    ("kills", "calibrate", 20), ("kills_on_a_cluster", "analyze", 12),
    ("lost_workers", "prune", 6), ("lost_workers_of_a_cluster", "prune", 4),
    ("late_workers", "prune", 6), ("late_workers", "excite", 4),
    ("frozen_schedulers", "prune", 6), ("frozen_schedulers", "excite", 4),
    ("spoilt_memories", "prune", 27), ("full_disks", "analyze", 9), ("small_disks", "analyze", 9),
    ("vanished", "analyze", 5),
)  # fmt: skip

#: Harm by what its problems say; whatever else they say is other harm.
HARM = {
    "results lost": ("no result after",),
    "files half-written": ("half file", "another result"),
    "times something executed": (
        "canary", "ran what", "os.system", "os.exec", "spawn", "fork", "Popen", "pickle",
        "loaded", "program computed",
    ),
    "over their limit": ("hung for", "waited ", " s of CPU", " MB", "out of memory"),
}  # fmt: skip


class EveryDay(ClusterDays, DiskDays):
    """A place where everything fails."""


def make_good(folder: Path) -> pd.DataFrame:
    """Write a good log and a good result, and return the log."""
    for line in (
        "simulate two-link a --noise paper --samples 400 --out good.csv",
        "analyze two-link good.csv --quick --engine serial --json fit.json",
    ):
        words = [sys.executable, "-m", "identifiability", *line.split()]
        subprocess.run(words, cwd=folder, check=True, capture_output=True)
    return pd.read_csv(folder / "good.csv")


def list_files(frame: pd.DataFrame, fit: Path) -> Iterator[list[Hostile]]:
    """Yield the hostile files, group by group, so that not all of them are held."""
    yield urdf.urdfs()
    yield urdf.sdfs()
    yield mjcf.mjcfs()
    yield documents.sidecars()
    yield documents.tables()
    yield documents.ladders()
    yield documents.limits()
    yield documents.trajectories()
    yield documents.results(fit)
    yield csv_text.csvs(frame)
    yield csv_text.file_names(frame)
    yield packed.parquets(frame)
    yield arrays.arrays(frame)
    yield sheets.sheets(frame)
    yield bags.bags(bags.good_bag(frame))


def judge_files(folder: Path, every: int = 1) -> list[Outcome]:
    """Return what came of every file, or of each so many-th."""
    frame = make_good(folder)
    start = judge.start_cost()
    found = []
    for group in list_files(frame, folder / "fit.json"):
        for case in group[::every]:
            found.append(judge.judge(case, folder, start))
            if found[-1].problems:
                sys.stderr.write(f"{found[-1].reader}, {case.name}: {found[-1].problems}\n")
    return found


def hit_commands(folder: Path, share: float = 1.0) -> list[Fault]:
    """Return what came of every fault."""
    days = EveryDay(folder / "good.csv", np.random.default_rng(19))
    found: list[Fault] = []
    for kind, command, count in FAULTS:
        for fault in getattr(days, kind)(command, max(1, round(share * count))):
            found.append(fault)
            if fault.problems:
                sys.stderr.write(f"{fault.kind}, {command}, {fault.what}: {fault.problems}\n")
    return found


def frame_files(found: Sequence[Outcome]) -> pd.DataFrame:
    """Return one row a reader."""
    rows = []
    for reader in dict.fromkeys(o.reader for o in found):
        of = [o for o in found if o.reader == reader]
        failed = sum(o.result == "failed" for o in of)
        slowest, largest = max(o.cpu for o in of), max(o.memory for o in of)
        rows.append(
            {
                "reader": reader,
                "files": len(of),
                "refused": sum(o.result == "refused" for o in of),
                "read": sum(o.result == "read" for o in of),
                "harm": Check(str(failed), failed == 0, "never"),
                "slowest [s CPU]": Check(f"{slowest:.1f}", slowest <= CPU, f"{CPU:g} s"),
                "largest [MB]": Check(f"{largest:.0f}", largest <= MEMORY / 1e6, "1 GB"),
            }
        )
    return pd.DataFrame(rows)


def frame_faults(found: Sequence[Fault]) -> pd.DataFrame:
    """Return one row a kind of fault and command."""
    rows = []
    for key in dict.fromkeys((f.kind, f.command) for f in found):
        of = [f for f in found if (f.kind, f.command) == key]
        failed = sum(bool(f.problems) for f in of)
        told = {"fault": key[0], "command": key[1], "faults": len(of)}
        rows.append(
            told
            | {
                "harm": Check(str(failed), failed == 0, "never"),
                "longest [s]": f"{max(f.seconds for f in of):.0f}",
            }
        )
    return pd.DataFrame(rows)


def count_harm(problems: Sequence[str]) -> dict[str, int]:
    """Return how many problems there are of each sort."""
    sorts = [next((h for h, w in HARM.items() if any(x in p for x in w)), "") for p in problems]
    return {sort: sorts.count(sort) for sort in HARM} | {"other harm": sorts.count("")}


def state(files: Sequence[Outcome], faults: Sequence[Fault]) -> str:
    """Return the answer in plain words."""
    bad = sum(o.result == "failed" for o in files), sum(bool(f.problems) for f in faults)
    parts = []
    if files:
        slowest, largest = max(o.cpu for o in files), max(o.memory for o in files)
        parts.append(
            f"Of {len(files)} hostile files {sum(o.result == 'refused' for o in files)} were "
            f"refused with one sentence, {sum(o.result == 'read' for o in files)} could be read "
            f"and {bad[0]} did harm; the slowest took {slowest:.1f} s of CPU with the start of the "
            f"program, the largest {largest:.0f} MB."
        )
    if faults:
        parts.append(
            f"Of {len(faults)} faults {bad[1]} lost something, left something or ended otherwise "
            "than in a sentence."
        )
    harm = count_harm([p for one in (*files, *faults) for p in one.problems])
    parts.append("Together: " + ", ".join(f"{count} {sort}" for sort, count in harm.items()) + ".")
    return " ".join(parts)


def write(files: Sequence[Outcome], faults: Sequence[Fault], out: Path) -> None:
    """Write the page and the numbers, and print where."""
    text = state(files, faults)
    harm: Iterator[tuple[str, tuple[str, ...]]] = chain(
        ((f"{o.reader}, {o.name}", o.problems) for o in files),
        ((f"{f.kind}, {f.command}, {f.what}", f.problems) for f in faults),
    )
    notes = tuple(Note("warning", name, "; ".join(why)) for name, why in harm if why)
    sections: list[Section] = []
    if files:
        lead = (
            "Harm: a traceback, a crash, more than 5 s of CPU or 1 GB, anything run, fetched, "
            "printed from elsewhere, left or written, a control character, no single sentence."
        )
        sections.append(Section("files", "Files", lead, (frame_table(frame_files(files)),)))
    if faults:
        lead = (
            "Harm: a half or another file, a traceback, a process that stays, a hang, something "
            "left over after the next run, other bits than without the fault. A signal in the "
            "first tenth of a second, before a line of this program runs, is answered by Python."
        )
        sections.append(Section("faults", "Faults", lead, (frame_table(frame_faults(faults)),)))
    if notes:
        sections.append(Section("harm", "Harm", "", (Notes(notes),)))
    method = (
        "Seeds are fixed: the files are the same in every run, moments of faults too. A file is "
        "read by a fork of the loaded command line with limits of address space, CPU and file size "
        "and an audit hook on what starts programs, speaks to a network or changes files elsewhere."
    )
    sections.append(Section("method", "Method", "", (Prose((method,)),)))
    out.parent.mkdir(parents=True, exist_ok=True)
    data: dict[str, Any] = {"schema": "identifiability/study/hostile_days/1", "statement": text}
    data["harm"] = count_harm([p for one in (*files, *faults) for p in one.problems])
    data |= {"files": [asdict(o) for o in files], "faults": [asdict(f) for f in faults]}
    print(text)
    print(write_json(out, data))
    page = out.with_suffix(".html")
    print(write_page("Hostile days", text, tuple(sections), page, overline="Study", subtitle=""))


def main(argv: Sequence[str] | None = None) -> tuple[list[Outcome], list[Fault]]:
    """Run the study."""
    parser = argparse.ArgumentParser(
        prog="hostile_days", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "hostile_days.json")
    parser.add_argument("--only", choices=("files", "faults"))
    parser.add_argument(
        "--quick", action="store_true", help="every 40th file, a tenth of the faults"
    )
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = [] if given.only == "faults" else judge_files(folder, 40 if given.quick else 1)
        if given.only == "faults":
            make_good(folder)
        share = 0.1 if given.quick else 1.0
        faults = [] if given.only == "files" else hit_commands(folder, share)
    write(files, faults, given.out)
    return files, faults


if __name__ == "__main__":
    main()
