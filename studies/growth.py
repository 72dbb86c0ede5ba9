"""How do time and memory grow with samples, joints, logs and replicates?

A six-axis arm in Parquet (samples, also diagnosed with two hidden effects, logs, replicates) and a
humanoid on a stand (joints), each command alone in a process with one thread, as a user would run
it. FIGAROH stands beside it where it can do the work: samples of the arm, with and without the
decimation of its workflow; it needs the extra ``bench``. ``python studies/growth.py`` takes
minutes, ``--full`` much longer.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import long_logs
import pandas as pd
from growing.humanoid import write_log, write_robot
from growing.runs import Took, exponent, run
from peers.running import make_samples

from identifiability.foundation.output import write_json
from identifiability.report import Prose, Section, frame_table, write_page
from identifiability.robot import Robot

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

ARM, ESTIMATORS = "six-dof-arm", ("ls", "auto")

#: What a diagnosis is to find: one effect of the first pass, one of the second.
HIDDEN = ("stribeck_friction@joint_2=0.05", "joint_stiffness@joint_4=0.05")

#: Sizes by default and with ``--full``.
QUICK = {
    "samples": (1_000, 10_000, 100_000),
    "diagnosed": (2_000, 100_000),
    "joints": (6, 12, 24),
    "logs": (1, 2, 4, 8),
    "replicates": (200, 2_000, 20_000),
}
FULL = {
    "samples": (1_000, 10_000, 100_000, 1_000_000, 10_000_000),
    "diagnosed": (2_000, 10_000, 100_000, 1_000_000),
    "joints": (6, 12, 24, 36),
    "logs": (1, 2, 4, 8, 16, 32),
    "replicates": (200, 2_000, 20_000, 200_000),
}

#: Samples of a log where something else grows.
SAMPLES = 2_000

#: FIGAROH holds the regressor of all samples: beyond these it does not fit here.
FIGAROH_MOST = 1_000_000


def analyze(who: str, what: str, size: int, *words: str, verb: str = "analyze") -> Took | None:
    """Run ``identifiability analyze``, or another verb, in one process."""
    argv = ("-m", "identifiability", verb, "--engine", "serial", *words)
    return run(who, what, size, argv)


def arm_log(folder: Path, samples: int, seed: int, *, derivatives: bool = False) -> str:
    """Write a log of the arm and return where."""
    path = folder / f"arm-{samples}-{seed}{'-full' * derivatives}.parquet"
    if not path.exists():
        long_logs.write_log(path, samples, seed, derivatives=derivatives)
    return str(path)


def grow_samples(folder: Path, sizes: Sequence[int]) -> Iterator[Took | None]:
    for size in sizes:
        log = arm_log(folder, size, 0)
        for kind in ESTIMATORS:
            yield analyze(f"analyze, {kind}", "samples", size, "--estimator", kind, ARM, log)
        words = ("--estimator", "ls", ARM, arm_log(folder, size, 0, derivatives=True))
        yield analyze("analyze, ls, derivatives given", "samples", size, *words)
        if find_spec("figaroh") is None or size > FIGAROH_MOST:
            continue
        with make_samples(size, 0) as made:
            argv = ("-m", "peers.process", "FIGAROH", str(made))
            yield run("FIGAROH", "samples", size, argv)
            argv = ("-m", "growing.figaroh_decimating", str(made))
            yield run("FIGAROH, decimating", "samples", size, argv)


def grow_diagnosed(folder: Path, sizes: Sequence[int]) -> Iterator[Took | None]:
    for size in sizes:
        log = folder / f"hidden-{size}.parquet"
        long_logs.write_log(log, size, 0, derivatives=False, hide=HIDDEN)
        yield analyze("diagnose", "diagnosed", size, ARM, str(log), verb="diagnose")


def grow_joints(folder: Path, sizes: Sequence[int]) -> Iterator[Took | None]:
    for size in sizes:
        path, log = folder / f"humanoid-{size}.xml", folder / f"humanoid-{size}.csv"
        write_robot(path, size)
        write_log(log, Robot.load(path), SAMPLES, 0)
        for kind in ESTIMATORS:
            words = ("--estimator", kind, str(path), str(log))
            yield analyze(f"analyze, {kind}", "joints", size, *words)
        for verb in ("prune", "calibrate"):
            words = ("--quick", str(path), str(log))
            yield analyze(f"{verb} --quick", "joints", size, *words, verb=verb)
        yield analyze("diagnose", "joints", size, str(path), str(log), verb="diagnose")


def grow_logs(folder: Path, sizes: Sequence[int]) -> Iterator[Took | None]:
    for size in sizes:
        logs = [arm_log(folder, SAMPLES, seed) for seed in range(size)]
        yield analyze("analyze, auto", "logs", size, ARM, *logs)


def grow_replicates(folder: Path, sizes: Sequence[int]) -> Iterator[Took | None]:
    log = arm_log(folder, SAMPLES, 0)
    for size in sizes:
        words = ("--replicates", str(size), ARM, log)
        yield analyze("analyze, auto", "replicates", size, *words)


GROWING = {
    "samples": grow_samples,
    "diagnosed": grow_diagnosed,
    "joints": grow_joints,
    "logs": grow_logs,
    "replicates": grow_replicates,
}


def growth_table(runs: Sequence[Took]) -> pd.DataFrame:
    """Return one row for each way and what grows, with the exponents."""
    rows = []
    for what in GROWING:
        for who in dict.fromkeys(r.who for r in runs if r.what == what):
            own = sorted((r for r in runs if (r.who, r.what) == (who, what)), key=lambda r: r.size)
            sizes = [r.size for r in own]
            rows.append(
                {
                    "what grows": what,
                    "who": who,
                    "sizes": ", ".join(f"{s:,}".replace(",", "\u2009") for s in sizes),
                    "processor [s]": ", ".join(f"{r.cpu:.1f}" for r in own),
                    "exponent of time": f"{exponent(sizes, [r.cpu for r in own]):.2f}",
                    "memory [MB]": ", ".join(f"{r.peak:.0f}" for r in own),
                    "exponent of memory": f"{exponent(sizes, [r.peak for r in own]):.2f}",
                }
            )
    return pd.DataFrame(rows)


def state(runs: Sequence[Took]) -> str:
    """Return the answer in plain words."""
    said = []
    for what in GROWING:
        verb = "diagnose" if what == "diagnosed" else "analyze"
        own = [r for r in runs if r.what == what and r.who.startswith(verb)]
        if own:
            most = max(own, key=lambda r: (r.size, r.cpu))
            size = f"{most.size:,}".replace(",", "\u2009")
            noun = "samples with two hidden effects" if what == "diagnosed" else what
            said.append(f"{size} {noun} take {most.cpu:.0f} s and {most.peak:.0f} MB")
    text = "; ".join(said) + "."
    beside = [r for r in runs if r.who.startswith("FIGAROH")]
    if not beside:
        return f"{text} FIGAROH is not installed here and was not measured."
    largest = max(r.size for r in beside)
    theirs = {r.who: r for r in beside if r.size == largest}
    each = " and ".join(f"{r.cpu:.1f} s, {r.peak:.0f} MB ({who})" for who, r in theirs.items())
    ours = next(r for r in runs if (r.who, r.what, r.size) == ("analyze, ls", "samples", largest))
    size = f"{largest:,}".replace(",", "\u2009")
    return (
        f"{text} {size} samples: {each}, for base parameters with σ from motion that is given; "
        f"{ours.cpu:.1f} s, {ours.peak:.0f} MB for a whole analysis from positions."
    )


def write(runs: Sequence[Took], out: Path) -> None:
    """Write the page and the numbers, and print where."""
    text = state(runs)
    lead = (
        "Processor time of a whole command, with starting Python, reading and all judgements; the "
        "exponent is that of what is added to the smallest size."
    )
    method = (
        f"The arm has {len(Robot.load(ARM).joints)} joints, the humanoid as many as are said; both "
        "follow Fourier motions, long logs of the arm one that repeats; logs hold positions and "
        f"torque. Where something else grows a log has {SAMPLES} samples. Instruments are made by "
        "`auto`.",
        "FIGAROH is called by its public functions in the order of its workflow on motion that is "
        "given; “decimating” also low-passes and decimates every column by ten, as its workflow "
        "does after the regressor of all samples is made.",
    )
    sections = (
        Section("growth", "Growth", lead, (frame_table(growth_table(runs)),)),
        Section("method", "Method", "", (Prose(method),)),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    data = {"schema": "identifiability/study/growth/1", "statement": text}
    print(text)
    print(write_json(out, data | {"runs": [vars(r) for r in runs]}))
    page = out.with_suffix(".html")
    print(write_page("How time and memory grow", text, sections, page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> list[Took]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="growth", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "growth.json")
    parser.add_argument("--full", action="store_true", help="36 joints, 10⁷ samples, 32 logs")
    parser.add_argument("--only", nargs="*", choices=list(GROWING), help="what is to grow")
    parser.add_argument("--sizes", nargs="+", type=int, help="of what is to grow, instead")
    given = parser.parse_args(argv)
    sizes = FULL if given.full else QUICK
    runs: list[Took] = []
    with tempfile.TemporaryDirectory(prefix="growth-") as folder:
        for what in given.only or GROWING:
            own = GROWING[what](Path(folder), given.sizes or sizes[what])
            runs += [r for r in own if r is not None]
    write(runs, given.out)
    return runs


if __name__ == "__main__":
    main()
