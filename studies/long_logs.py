"""Do time and memory hold on logs that do not fit in memory: 10⁵ to 10⁷ samples of a six-dof arm?

A trajectory of the arm is repeated with fresh noise and written in chunks; the commands then run
as a user would run them, and all their processes are watched.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from scipy import signal

from identifiability.foundation.output import write_json
from identifiability.report import Check, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import PrescribedMotion, shipped_trajectory, simulate

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

ROBOT, TRAJECTORY, PERIOD = "six-dof-arm", "a", 20_000

#: Standard deviation of the torque noise relative to each joint's torque, and its memory.
NOISE, RHO = 0.05, 0.9

#: What must hold: memory of all processes together [MB], and time per sample beside a tenth of it.
MOST_MEMORY, MOST_GROWTH = 1000.0, 1.3

#: Seconds between looks at the processes.
WATCH = 0.05


@dataclass(frozen=True)
class Run:
    """A command that was watched.

    Attributes
    ----------
    command, form : str
    samples : int
    file_mb, seconds, cpu : float
        Size of the log [MB], wall and processor time [s].
    peak : float
        Largest memory of all its processes at one time, pages that they share counted once [MB].
    peaks : float
        Sum of the largest resident memory of each process, whenever that was, shared pages
        counted in each [MB].
    processes : int
    """

    command: str
    form: str
    samples: int
    file_mb: float
    seconds: float
    cpu: float
    peak: float
    peaks: float
    processes: int


def write_log(
    path: Path, samples: int, seed: int, *, derivatives: bool, hide: Sequence[str] = ()
) -> None:
    """Write a long log period by period; `hide` is what is in the data and not in the robot."""
    robot = Robot.load(ROBOT)
    motion = PrescribedMotion.of(shipped_trajectory(robot, TRAJECTORY), PERIOD)
    clean = simulate(robot, motion, hide=hide).to_frame()
    if not derivatives:
        clean = clean[[c for c in clean.columns if not c.endswith(("dq", "ddq"))]]
    step = float(np.median(np.diff(clean["t"])))
    rng = np.random.default_rng(seed)
    torques = [c for c in clean.columns if c.endswith(".tau")]
    size = NOISE * clean[torques].std().to_numpy()
    writer, held = None, np.zeros((1, len(torques)))
    for start in range(0, samples, PERIOD):
        part = clean.iloc[: samples - start].copy()
        part["t"] = step * (start + np.arange(len(part)))
        noise = rng.standard_normal((len(part), len(torques))) * np.sqrt(1 - RHO**2)
        # AR(1), across the seams too.
        noise, held = signal.lfilter([1], [1, -RHO], noise, axis=0, zi=held)
        part[torques] += size * noise
        table = pa.Table.from_pandas(part, preserve_index=False)
        if writer is None:
            csv = path.suffix == ".csv"
            writer = (pa.csv.CSVWriter if csv else pa.parquet.ParquetWriter)(path, table.schema)
        writer.write_table(table)
    assert writer is not None
    writer.close()


def processes_of(root: int) -> Iterator[int]:
    """Yield a process and all below it."""
    yield root
    try:
        children = Path(f"/proc/{root}/task/{root}/children").read_text().split()
    except OSError:
        return
    for child in children:
        yield from processes_of(int(child))


def memory_of(process: int) -> tuple[float, float]:
    """Return memory now, with its share of shared pages, and resident memory at most [MB]."""
    try:
        shares = Path(f"/proc/{process}/smaps_rollup").read_text()
        lines = shares + Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0, 0.0
    found = {k: v for k, _, v in (line.partition(":") for line in lines.splitlines())}
    now, most = (found.get(k, "0 kB").split()[0] for k in ("Pss", "VmHWM"))
    return float(now) / 1000, float(most) / 1000


def watch(command: Sequence[str], log: Path, samples: int, folder: Path) -> Run:
    """Run a command on a log and watch its processes."""
    begin = time.perf_counter()
    argv = [sys.executable, "-m", "identifiability", *command, ROBOT, str(log)]
    argv += ["--json", str(folder / "result.json"), "--report", str(folder / "result.html")]
    with subprocess.Popen(argv, stdout=subprocess.DEVNULL) as running:
        largest, most, cpu = 0.0, dict[int, float](), dict[int, float]()
        while running.poll() is None:
            total = 0.0
            for process in processes_of(running.pid):
                now, high = memory_of(process)
                total += now
                most[process] = high or most.get(process, 0.0)  # a fork begins as its parent
                cpu[process] = max(cpu.get(process, 0.0), processor_time(process))
            largest = max(largest, total)
            time.sleep(WATCH)
    if running.returncode:
        raise SystemExit(f"{' '.join(argv)} failed")
    size = log.stat().st_size / 1e6
    return Run(
        command[0], log.suffix[1:], samples, size, time.perf_counter() - begin,
        sum(cpu.values()), largest, sum(most.values()), len(most),
    )  # fmt: skip


def processor_time(process: int) -> float:
    """Return the processor time of a process [s]."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / 100


def run_frame(runs: Sequence[Run]) -> pd.DataFrame:
    """Return one row a run, with what is asked of it."""
    rows = []
    for r in runs:
        smaller = [s for s in runs if (s.command, s.form) == (r.command, r.form)
                   and s.samples * 10 == r.samples]  # fmt: skip
        rate = 1e6 * r.seconds / r.samples
        text: object = f"{rate:.1f}"
        if smaller:
            growth = r.seconds / (10 * smaller[0].seconds)
            text = Check(f"{rate:.1f}", growth <= MOST_GROWTH, f"at most {MOST_GROWTH} × above")
        rows.append(
            {
                "command": r.command,
                "log": f"{r.form}, {r.file_mb:.0f} MB",
                "samples": spaced(r.samples),
                "wall [s]": f"{r.seconds:.1f}",
                "processor [s]": f"{r.cpu:.1f}",
                "µs a sample": text,
                "processes": r.processes,
                "memory at most [MB]": Check(
                    f"{r.peak:.0f}", r.peak <= MOST_MEMORY, f"at most {MOST_MEMORY:.0f}"
                ),
                "peaks of all, added [MB]": f"{r.peaks:.0f}",
            }
        )
    return pd.DataFrame(rows)


def spaced(count: int) -> str:
    """Return a whole number with thin spaces between thousands."""
    return f"{count:,}".replace(",", "\u2009")


def write(runs: Sequence[Run], out: Path) -> None:
    """Write the page and the numbers, and print where."""
    longest = max(runs, key=lambda r: r.samples)
    text = (
        f"{longest.command} of {spaced(longest.samples)} samples: {longest.seconds:.0f} s, and "
        f"never more than {longest.peak:.0f} MB in all {longest.processes} processes together."
    )
    lead = (
        f"{ROBOT}, trajectory {TRAJECTORY} repeated, torque noise {100 * NOISE:g} % with an AR(1) "
        f"correlation of {RHO:g}. The largest count of processes includes helpers that only track "
        "the others. Wall time includes starting Python and the report."
    )
    section = Section("runs", "Commands", lead, (frame_table(run_frame(runs)),))
    out.parent.mkdir(parents=True, exist_ok=True)
    data = {"schema": "identifiability/study/long_logs/1", "statement": text}
    print(text)
    print(write_json(out, data | {"runs": [vars(r) for r in runs]}))
    page = out.with_suffix(".html")
    print(write_page("How long may logs be?", text, (section,), page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> list[Run]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="long_logs", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "long_logs.json")
    parser.add_argument("--quick", action="store_true", help="no more than 10⁶ samples")
    parser.add_argument("--only", nargs="*", help="as analyze:1000000, prune:1000000:csv …")
    parser.add_argument("--positions", action="store_true", help="logs without derivatives")
    parser.add_argument("--folder", type=Path, help="where logs are written, and kept")
    parser.add_argument("--estimator", default="auto", help="of analyze")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    wanted = given.only or [
        "analyze:100000", "analyze:1000000", "prune:1000000", "diagnose:1000000",
        "analyze:1000000:csv", *([] if given.quick else ["analyze:10000000"]),
    ]  # fmt: skip
    folder = given.folder or Path(tempfile.mkdtemp(prefix="long-logs-"))
    folder.mkdir(parents=True, exist_ok=True)
    runs = []
    try:
        for text in wanted:
            command, count, *form = text.split(":")
            kind = "positions" if given.positions else "full"
            log = folder / f"{kind}-{count}.{form[0] if form else 'parquet'}"
            if not log.exists():
                write_log(log, int(count), given.seed, derivatives=not given.positions)
            words = [command, *(["--estimator", given.estimator] if command == "analyze" else [])]
            runs.append(watch(words, log, int(count), folder))
            print(runs[-1], flush=True)
    finally:
        if given.folder is None:
            shutil.rmtree(folder)
    write(runs, given.out)
    return runs


if __name__ == "__main__":
    main()
