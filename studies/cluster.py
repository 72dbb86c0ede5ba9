"""Is a table of the paper the same when a worker of a cluster dies, or a run is stopped?

Table 3 is computed here, one trial after the other; on a local Dask cluster of two workers, one of
which is killed half-way; and by the command line, which is stopped by Ctrl-C after a third, killed
after two thirds, and started again with the same --resume folder. The files must be the same.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from paper_study.cluster_page import Run, Stop, write_cluster_page
from paper_study.command import ROOT, Options, run_studies
from paper_study.index import write_index
from paper_study.monte_carlo import forget_trials
from paper_study.watched import Watched

from identifiability.cli.common import progress, sentences
from identifiability.foundation.engines.cluster import Dask
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.errors import IdentifiabilityError

TABLE = "table_3_noise"


def digest_of(folder: Path) -> str:
    """Return a digest of the table's JSON and HTML."""
    parts = [(folder / f"{TABLE}{end}").read_bytes() for end in (".json", ".html")]
    return hashlib.sha256(b"".join(hashlib.sha256(p).digest() for p in parts)).hexdigest()


def compute_here(engine: Engine, folder: Path, options: Options, name: str) -> Run:
    """Compute the table on an engine, from nothing."""
    forget_trials()
    watched = Watched(engine, folder / f"{name}.txt")
    start = time.time()
    given = Options(options.quick, options.seeds, watched, progress=options.progress)
    run_studies([TABLE], given, folder / name)
    return Run(digest_of(folder / name), time.time() - start, tuple(watched.visits()))


def compute_on_cluster(folder: Path, options: Options, items: int) -> Run:
    """Compute the table on two workers; the one that is at work half-way is killed."""
    forget_trials()
    killed: list[float] = []
    with Dask(workers=2) as cluster:
        watched = Watched(cluster, folder / "cluster.txt")

        def kill_once(what: str, share: float) -> None:
            options.say(what, share)
            visits = watched.visits()
            busy = [v.worker for v in visits if v.lost]
            if not killed and busy and sum(not v.lost for v in visits) >= items / 2:
                os.kill(busy[0], signal.SIGKILL)
                killed.append(time.time())

        start = time.time()
        given = Options(options.quick, options.seeds, watched, progress=kill_once)
        run_studies([TABLE], given, folder / "cluster")
        seconds = time.time() - start
    if not killed:
        raise IdentifiabilityError("No worker could be killed half-way; give more --seeds.")
    return Run(digest_of(folder / "cluster"), seconds, tuple(watched.visits()), killed[0])


def compute_with_stops(
    folder: Path, options: Options, items: int
) -> tuple[Run, list[Stop], list[tuple[float, int]]]:
    """Compute the table by the command line, stopped twice; return also what was kept over time."""
    out, work = folder / "stopped", folder / "work"
    words = [sys.executable, "-m", "identifiability", "paper", TABLE, "--seeds", str(options.draws)]
    words += ["--quick"] * options.quick + ["--out", str(out), "--resume", str(work)]
    words += ["--workers", "2"]
    stops: list[Stop] = []
    curve: list[tuple[float, int]] = []
    start = time.time()
    for sign, most in ((signal.SIGINT, items / 3), (signal.SIGKILL, 2 * items / 3), (None, 0.0)):
        before = _kept(work)
        began, asked = time.time(), None
        run = subprocess.Popen(
            words, cwd=ROOT, start_new_session=True, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        while run.poll() is None:
            kept = sum(1 for _ in work.rglob("*.result"))
            curve.append((time.time() - start, kept))
            options.say(f"{kept} of {items} kept", min(kept / items, 1.0))
            if sign is not None and asked is None and kept >= most:
                asked = time.time()
                run.send_signal(sign)
            time.sleep(0.1)
        seconds = time.time() - (asked or began)
        time.sleep(2)  # workers of a killed program notice its end within a second
        after = _kept(work)
        intact = all(after.get(p) == t for p, t in before.items())
        how = "ran to its end" if asked is None or sign is None else sign.name
        stops.append(Stop(how, seconds, len(before), len(after), intact, count_group(run.pid)))
    return Run(digest_of(out), time.time() - start), stops, curve


def _kept(work: Path) -> dict[Path, int]:
    """Return the finished pieces in a folder and when each was written."""
    return {path: path.stat().st_mtime_ns for path in work.rglob("*.result")}


def count_group(leader: int) -> int:
    """Return how many processes of a group live."""
    found = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True)
    rows = [line.split() for line in found.stdout.splitlines()]
    return sum(int(group) == leader and not state.startswith("Z") for group, state in rows)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the study; return 0 if everything is the same, 1 if not."""
    parser = argparse.ArgumentParser(prog="cluster", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports", help="folder (reports)")
    parser.add_argument("--seeds", type=int, help="trials of every case (40; 4 if quick)")
    parser.add_argument("--quick", action="store_true", help="few trials")
    given = parser.parse_args(argv)
    with sentences(), progress() as say, tempfile.TemporaryDirectory() as name:
        folder, options = Path(name), Options(given.quick, given.seeds, progress=say)
        here = compute_here(Serial(), folder, options, "here")
        items = len(here.visits)
        cluster = compute_on_cluster(folder, options, items)
        stopped, stops, curve = compute_with_stops(folder, options, items)
    given.out.mkdir(parents=True, exist_ok=True)
    runs = (here, cluster, stopped)
    passed, paths = write_cluster_page(given.out, options.draws, runs, stops, curve)
    write_index(given.out)
    print(*paths, sep="\n")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
