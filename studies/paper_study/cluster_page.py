"""The page of the study on a cluster: was the result the same, who did what, what was kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from identifiability.foundation.output import write_json
from identifiability.report import (
    COLOURS,
    Check,
    Picture,
    Prose,
    Section,
    Tile,
    canvas,
    drawn,
    frame_table,
    write_page,
)
from paper_study.watched import Visit

SIGNALS = ("SIGINT", "SIGKILL")

METHOD = (
    "Every draw of the noise has its own seed, which goes with the piece of work, and every piece "
    "is computed with one BLAS thread. So it does not matter who does it, or in which order.",
    "The killed worker gets SIGKILL from outside while it works on a piece. The scheduler gives "
    "its pieces to the other worker and starts a new one. Results that the dead worker held and "
    "nobody had fetched yet are done again as well.",
    "The command line is stopped by SIGINT after a third of the pieces and by SIGKILL after two "
    "thirds, and then runs to its end. A kept piece is found by a digest of its input and of the "
    "program, and its file has a checksum. Pieces under way when the run is stopped are lost.",
    "Compared are the table's JSON and HTML files as they are written.",
)


@dataclass(frozen=True)
class Run:
    """One way to the table.

    Attributes
    ----------
    digest : str
        Of the files of results, JSON and HTML.
    seconds : float
    visits : tuple of Visit
        Who did what; empty for the command line.
    killed : float
        When a worker was killed, seconds since the epoch; NaN for never.
    """

    digest: str
    seconds: float
    visits: tuple[Visit, ...] = ()
    killed: float = float("nan")


@dataclass(frozen=True)
class Stop:
    """One start of the command line: how it ended, and what was in the folder before and after."""

    how: str
    seconds: float
    before: int
    after: int
    intact: bool
    left: int


@drawn
def draw_timeline(visits: Sequence[Visit], killed: float) -> Figure:
    """Draw what each worker did and when."""
    start = min(v.start for v in visits)
    workers = list(dict.fromkeys(v.worker for v in visits))
    figure, (axes,) = canvas(760, 90 + 44 * len(workers), (86, 12, 40, 40))
    for row, worker in enumerate(workers):
        for v in (v for v in visits if v.worker == worker):
            colour = "vermilion" if v.lost else "blue"
            end = killed if v.lost else v.end
            axes.barh(row, end - v.start, 0.6, v.start - start, color=COLOURS[colour],
                      edgecolor=COLOURS["surface"], linewidth=0.6)  # fmt: skip
    axes.axvline(killed - start, color=COLOURS["vermilion"], linestyle="--")
    axes.annotate("killed", (killed - start, 1.02), xycoords=("data", "axes fraction"),
                  color=COLOURS["vermilion"], ha="center")  # fmt: skip
    axes.set_yticks(range(len(workers)), [f"worker {k + 1}" for k in range(len(workers))])
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("time [s]")
    return figure


@drawn
def draw_kept(curve: Sequence[tuple[float, int]], items: int) -> Figure:
    """Draw how many finished pieces the folder held over time."""
    t, kept = np.array(curve).T
    figure, (axes,) = canvas(760, 240, (86, 12, 20, 40))
    for a, b in pairwise([0, *(np.flatnonzero(np.diff(t) > 1.5) + 1), len(t)]):
        axes.plot(t[a:b], kept[a:b], color=COLOURS["blue"])
        axes.plot(t[b - 1], kept[b - 1], "o", color=COLOURS["vermilion" if b < len(t) else "blue"])
    axes.axhline(items, color=COLOURS["muted"], linestyle=":")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("finished pieces kept")
    return figure


def workers_table(run: Run) -> pd.DataFrame:
    """Return one row a worker of the cluster."""
    start = min(v.start for v in run.visits)
    rows = []
    for k, worker in enumerate(dict.fromkeys(v.worker for v in run.visits)):
        own = [v for v in run.visits if v.worker == worker]
        ends = [run.killed if v.lost else v.end for v in own]
        span = f"{own[0].start - start:.1f} … {max(ends) - start:.1f} s"
        row = {"worker": f"worker {k + 1}", "finished": sum(not v.lost for v in own)}
        rows.append(row | {"under way when killed": sum(v.lost for v in own), "at work": span})
    return pd.DataFrame(rows)


def results_table(runs: dict[str, Run]) -> pd.DataFrame:
    """Return the digest of the files of every run beside that of the first."""
    first = next(iter(runs.values())).digest
    return pd.DataFrame(
        [
            {
                "run": name,
                "files (SHA-256)": f"{run.digest[:16]}…",
                "same to the last bit": Check("yes" if run.digest == first else "no",
                                              run.digest == first, "JSON and HTML"),
                "time [s]": f"{run.seconds:.0f}",
            }
            for name, run in runs.items()
        ]
    )  # fmt: skip


def stops_table(stops: Sequence[Stop]) -> pd.DataFrame:
    """Return one row a start of the command line."""
    return pd.DataFrame(
        [
            {
                "start": k,
                "ended by": stop.how,
                "after that [s]": "" if stop.how not in SIGNALS else f"{stop.seconds:.1f}",
                "found finished": stop.before,
                "done": stop.after - stop.before,
                "done again": Check("0" if stop.intact else "some", stop.intact, "files unchanged"),
                "processes left": Check(str(stop.left), stop.left == 0, "none"),
            }
            for k, stop in enumerate(stops, 1)
        ]
    )


def write_cluster_page(
    out: Path,
    draws: int,
    found: tuple[Run, Run, Run],
    stops: Sequence[Stop],
    curve: Sequence[tuple[float, int]],
) -> tuple[bool, list[Path]]:
    """Write the page and its numbers; return whether all is as it should be, and the paths."""
    here, cluster, _ = found
    names = ("here, one trial after the other", "cluster of two workers, one killed",
             "command line, stopped twice")  # fmt: skip
    runs = dict(zip(names, found, strict=True))
    items = len(here.visits)
    again = len(cluster.visits) - items
    same = len({run.digest for run in runs.values()}) == 1
    kept = all(s.intact and s.left == 0 for s in stops) and stops[-1].after == items
    saved = stops[-1].before
    result = "is the same to the last bit" if same else "IS NOT THE SAME"
    statement = (
        f"Table 3 of the paper ({items} pieces of work, {draws} draws a case) {result} on a Dask "
        "cluster of two workers of which one was killed half-way (what went with it was done "
        f"again: {again} of {items} pieces), and in a run that was stopped by Ctrl-C, killed, and "
        f"started again: {saved} of {items} pieces were not done again."
    )
    sections = [
        Section("results", "The same result?", "", (frame_table(results_table(runs)),)),
        Section(
            "cluster", "The cluster", "Who did what. A worker that dies is replaced.",
            (
                Picture(
                    draw_timeline(cluster.visits, cluster.killed),
                    "Each block is one piece of work; in red what the killed worker was at.",
                ),
                frame_table(workers_table(cluster)),
            ),
        ),
        Section(
            "resume", "Stopped and resumed", "Three starts of the same command with --resume.",
            (
                Picture(
                    draw_kept(curve, items),
                    "Finished pieces in the folder; dots mark the end of a start.",
                ),
                frame_table(stops_table(stops)),
            ),
        ),
        Section("method", "How it was done", "", (Prose(METHOD),)),
    ]  # fmt: skip
    tiles = [
        Tile(
            "yes" if same else "no", "same to the last bit", tone="green" if same else "vermilion"
        ),
        Tile(f"{saved} / {items}", "pieces not done again"),
    ]
    data = {
        "schema": "identifiability/study/cluster/1",
        "statement": statement,
        "passed": same and kept,
        "pieces": items,
        "draws": draws,
        "digests": {name: run.digest for name, run in runs.items()},
        "seconds": {name: run.seconds for name, run in runs.items()},
        "done_again": again,
        "killed": cluster.killed - cluster.visits[0].start,
        "visits": [asdict(v) for v in cluster.visits],
        "starts": [asdict(s) for s in stops],
    }
    path = write_page(
        "Killed workers and interrupted runs", statement, sections, out / "cluster.html",
        overline="Study", subtitle="3-RPS, the Monte-Carlo trials of Table 3", tiles=tiles,
    )  # fmt: skip
    return same and kept, [write_json(out / "cluster.json", data), path]
