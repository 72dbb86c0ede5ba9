"""How fast are fits of motion and torque, compared with Pinocchio's loop and FIGAROH?

The shipped six-axis arm with viscous and Coulomb friction (72 parameters, 48 independent), the same
samples for everybody, one thread, each contender alone in a process of its own. Without the extra
``bench`` FIGAROH is left out, and the page says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from peers.figures import draw_growth, draw_phases
from peers.running import Measured, make_samples, run_contender
from peers.tables import (
    FITS,
    MEGABYTES,
    PHYSICAL,
    agreement,
    agreement_physical,
    all_agree,
    find,
    reason,
    targets,
    time_table,
    versions,
)
from shared import study_parser

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import check_ending, check_writable, write_json
from identifiability.report import Gallery, Picture, Prose, Section, frame_table, write_page

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

SAMPLES = (1_000, 10_000, 100_000, 1_000_000)

#: The number of samples that is asked about.
MAIN = 100_000

#: A contender is ended after so long [s].
MOST = 600.0


def measure(sizes: Sequence[int], repeats: int, seed: int) -> list[Measured]:
    """Run every contender on every number of samples.

    Contenders that exceeded the time limit are not run again.
    """
    out: list[Measured] = []
    ended: set[str] = set()
    for count in sizes:
        with make_samples(count, seed) as folder:
            for name in (*FITS, *PHYSICAL):
                if name in ended:
                    why = "a tenth of the samples took too long already"
                    out.append(Measured(name, count, why=why))
                    continue
                times = repeats if count <= MAIN and name != "cvxpy, all rows" else 1
                found = run_contender(name, folder, count, times, MOST)
                out.append(found)
                # All rows in cvxpy grow faster than the samples.
                if not found.ran or 8 * found.seconds > MOST:
                    ended.add(name)
                print(f"{name}, {count}: {found.why or f'{found.seconds:.3g} s'}", flush=True)
    return out


def lines(runs: Sequence[Measured], names: Sequence[str], what: str) -> dict[str, Any]:
    """Return samples and values of every contender that ran."""
    out = {}
    for name in names:
        ran = [r for r in runs if r.name == name and r.ran]
        if ran:
            values = [getattr(r, what) for r in ran]
            out[name] = np.array([r.samples for r in ran]), np.array(values)
    return out


def phase_picture(runs: Sequence[Measured], names: Sequence[str], samples: int) -> Picture:
    """Return the processor time of each phase at a number of samples."""
    ran = [r for r in (find(runs, n, samples) for n in names) if r is not None]
    order = list(dict.fromkeys(k for r in ran for k in r.phases))
    phases = {k: np.array([r.phases.get(k, (0.0, 0.0))[0] for r in ran]) for k in order}
    figure = draw_phases([r.name for r in ran], phases, "processor time [s]")
    return Picture(figure, f"Where the time goes, {samples:,} samples.".replace(",", "\u2009"))


def state(runs: Sequence[Measured], at: int, agree: bool) -> str:
    """Return the answer in plain words."""
    if not agree:
        return "The answers differ, so the times say nothing: see “Do they agree?”."
    ours = find(runs, "ours", at)
    assert ours is not None
    count = f"{at:,}".replace(",", "\u2009")
    text = (
        f"From {count} samples of a six-axis arm to its base parameters with σ it takes "
        f"{ours.seconds:.2g} s of one processor and {ours.peak:.0f} MB"
    )
    quick = find(runs, "FIGAROH, pivoting", at)
    flow = find(runs, "FIGAROH", at)
    if quick is None or flow is None:
        return f"{text}. FIGAROH was not measured: {reason(runs, 'FIGAROH', at)}."
    return (
        f"{text}, {quick.seconds / ours.seconds:.1f} times less time than FIGAROH in its quickest "
        f"way, {flow.seconds / ours.seconds:.1f} times less than in that of its workflow, and "
        f"{quick.peak / ours.peak:.0f} times less memory. All answers are the same."
    )


def sections(runs: Sequence[Measured], at: int) -> list[Section]:
    """Return the sections of the page."""
    times = draw_growth(lines(runs, FITS, "seconds"), "processor time [s]")
    peaks = draw_growth(lines(runs, FITS, "peak"), "memory [MB]", (MEGABYTES, "300 MB"))
    real = draw_growth(lines(runs, PHYSICAL, "seconds"), "processor time [s]")
    room = draw_growth(lines(runs, PHYSICAL, "peak"), "memory [MB]")
    bars = [phase_picture(runs, names, at) for names in (FITS, PHYSICAL)]
    method = (
        "Torque is Pinocchio's inverse dynamics with the file's values and friction, and 1 % white "
        "noise. Every contender starts from the same arrays, in a process of its own with one "
        "thread; imports and reading are not timed. Processor time is counted, since other work "
        "does not disturb it; the fastest of the repetitions is shown. Memory is the largest "
        "resident size of the process, imports and samples included.",
        "The bare loop writes rigid-body columns into an array that is there already; it estimates "
        "nothing. FIGAROH is called by its public functions in the order of its workflow, without "
        "decimation, logging and plots: the workflow's double QR, and its other way, pivoting, "
        "which is quicker. Its physical fit is the direct effort fit with its own settings; it "
        "compresses all rows by QR first, and checks its answer on all rows afterwards.",
        "Ours never holds the regressor: it is compressed chunk by chunk, so that its phase "
        "contains most of the work of least squares. It keeps 256 blocks of time for the bootstrap "
        "that others do not make; at 1000 samples that is most of its time, and FIGAROH is faster.",
        "; ".join(f"{k} {v}" for k, v in versions().items()) + ".",
    )
    return [
        Section("targets", "What is asked", "", (frame_table(targets(runs, at)),)),
        Section(
            "fits", "From motion and torque to base parameters with σ",
            "Ordinary least squares with standard deviations, 72 parameters, 48 independent.",
            (Gallery((Picture(times, "Time."), Picture(peaks, "Memory."))), bars[0],
             frame_table(time_table(runs, FITS))),
        ),
        Section(
            "physical", "To the parameters of a real robot",
            "The same data under one matrix inequality a body.",
            (Gallery((Picture(real, "Time."), Picture(room, "Memory."))), bars[1],
             frame_table(time_table(runs, PHYSICAL))),
        ),
        Section(
            "agreement", "Do they agree?",
            "Largest relative differences from our answers at 200 samples. Torque, its σ and the "
            "noise do not depend on which base parameters were chosen.",
            (frame_table(agreement(runs).fillna("")), frame_table(agreement_physical(runs))),
        ),
        Section("method", "Method", "", (Prose(method),)),
    ]  # fmt: skip


def write(runs: Sequence[Measured], out: Path, seed: int) -> None:
    """Write the page and the numbers, and print where."""
    sizes = sorted({r.samples for r in runs})
    at = MAIN if MAIN in sizes else sizes[-1]
    agree = all_agree(runs)
    text = state(runs, at, agree)
    print(text)
    keys = ("name", "samples", "phases", "imports", "peak", "why")
    data = {
        "schema": "identifiability/study/benchmark_peers/1",
        "statement": text,
        "seed": seed,
        "versions": versions(),
        "runs": [{k: getattr(r, k) for k in keys} for r in runs],
        "agree": agree,
    }
    print(write_json(out, data))
    print(
        write_page(
            "How fast, beside others?", text, sections(runs, at), out.with_suffix(".html"),
            overline="Benchmark", subtitle="six-axis arm, viscous and Coulomb friction",
        )
    )  # fmt: skip


def main(argv: Sequence[str] | None = None) -> list[Measured]:
    """Run the benchmark."""
    parser = study_parser("benchmark_peers", __doc__, "1000 and 10,000 samples, once each")
    parser.add_argument("--samples", type=int, nargs="+", default=SAMPLES)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    try:
        given.out.parent.mkdir(parents=True, exist_ok=True)
        check_ending(given.out, ".json")
        for path in (given.out, given.out.with_suffix(".html")):
            check_writable(path)
    except (IdentifiabilityError, OSError) as error:
        parser.error(str(error))
    sizes, repeats = (SAMPLES[:2], 1) if given.quick else (given.samples, given.repeats)
    runs = measure(sizes, repeats, given.seed)
    write(runs, given.out, given.seed)
    return runs


if __name__ == "__main__":
    main()
