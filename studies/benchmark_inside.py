"""How much faster is the inner work than its naive form, and are the answers the same?

The 3-RPS at the paper's noise, its unpruned model of 37 parameters, with 750 and with 10,000
samples; the diagnosis on two logs with a hidden Stribeck effect. One process, one thread, but
for the closed chain, whose samples two processes share.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from inside import closing, draws, elimination, program, refits, scores
from inside.closing import Pace
from inside.pair import Pair
from peers.figures import draw_pairs, times_faster
from peers.tables import versions
from posterior_speed import analyse
from threadpoolctl import threadpool_limits

from identifiability.foundation.output import write_json
from identifiability.report import Check, Picture, Prose, Section, frame_table, write_page
from identifiability.workflows.analyze import Analysis

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

SAMPLES = (750, 10_000)

#: Samples of the closed chain, and what is asked of two processes [µs a sample].
CLOSED, MOST = 100_000, 20.0


def pairs(*, quick: bool, seed: int) -> Iterator[tuple[int, Pair]]:
    """Yield number of samples and result of every comparison."""
    part = 0.1 if quick else 1.0
    count, repeats = int(1000 * part), 2 if quick else 7
    first: Analysis | None = None
    for samples in SAMPLES[:1] if quick else SAMPLES:
        analysis = analyse(seed, samples)
        first = first or analysis
        works: list[Callable[[Analysis], Pair]] = [
            lambda a: refits.measure(a, count, seed),
            lambda a: program.measure(a, repeats),
            lambda a: elimination.measure(a, repeats),
        ]
        for work in works:
            yield samples, work(analysis)
    assert first is not None
    count = int(2000 * part)
    yield count, closing.measure(count, repeats)
    yield SAMPLES[0], draws.measure(first, max(20, int(200 * part)), 60 * part, seed)
    yield 2 * SAMPLES[0], scores.measure(int(200 * part), 1000, seed)


def table(found: Sequence[tuple[int, Pair]]) -> pd.DataFrame:
    """Return one row a comparison."""
    return pd.DataFrame(
        [
            {
                "work": p.name,
                "samples": samples,
                "how much": p.work,
                "naive form": p.naive_form,
                "ours [s]": f"{p.ours:.3g}",
                "naive [s]": f"{p.naive:.3g}",
                "times faster": times_faster(p.ratio),
                "difference": Check(f"{p.gap:.1e}", p.agree, f"at most {p.most:g}"),
                "of": p.measure,
            }
            for samples, p in found
        ]
    )


def paces(*, quick: bool) -> list[Pace]:
    """Return the pace of the closed chain in one and in two processes."""
    return [closing.pace(CLOSED // 10 if quick else CLOSED, k) for k in (1, 2)]


def pace_table(found: Sequence[Pace]) -> pd.DataFrame:
    """Return one row a number of processes."""
    rows = []
    for p in found:
        each = p.processor / p.processes
        rows.append(
            {
                "processes": p.processes,
                "samples": p.samples,
                "processor, all [µs a sample]": f"{p.processor:.1f}",
                "processor, each [µs a sample]": Check(
                    f"{each:.1f}", each <= MOST, f"at most {MOST:g}"
                ),
                "wall [µs a sample]": f"{p.wall:.1f}",
            }
        )
    return pd.DataFrame(rows)


def state(found: Sequence[tuple[int, Pair]]) -> str:
    """Return the answer in plain words."""
    wrong = [p.name for _, p in found if not p.agree]
    if wrong:
        return f"The answers of {', '.join(wrong)} differ, so these times say nothing."
    least = min(p.ratio for _, p in found)
    most = max(p.ratio for _, p in found)
    return (
        f"Bootstrap, posterior, semidefinite program, pruning, diagnosis and the closing of loops "
        f"give the answers of their naive forms {times_faster(least)} to {times_faster(most)} "
        f"times faster."
    )


def write(found: Sequence[tuple[int, Pair]], closed: Sequence[Pace], out: Path, seed: int) -> None:
    """Write the page and the numbers, and print where."""
    names = [f"{p.name}, {samples}" for samples, p in found]
    figure = draw_pairs(
        names, np.array([p.ours for _, p in found]), np.array([p.naive for _, p in found]),
        "processor time [s]",
    )  # fmt: skip
    method = (
        "After the information has been gathered once, none of these knows how "
        "many samples there were; the naive forms read all rows each time. "
        "Gathering is not counted. Each naive form works on the same rows, weights, resampled "
        "blocks and simulated noises; least squares is LAPACK's by NumPy. Imports are not timed. "
        "Our semidefinite program pulls what the data leave open towards the robot file, which is "
        "the difference of some hundredths of σ².",
        "; ".join(f"{k} {v}" for k, v in versions().items()) + ".",
    )
    sections = (
        Section(
            "pairs", "Ours and the naive form", "",
            (Picture(figure, "Time of both, and their ratio; the number is that of samples."),
             frame_table(table(found))),
        ),
        Section(
            "closed", "Closed chains in two processes",
            "The 3-RPS from the motion of its three actuated joints to the regressor projected on "
            "them. Where the machine has nothing else to do, wall time is that of each process.",
            (frame_table(pace_table(closed)),),
        ),
        Section("method", "Method", "", (Prose(method),)),
    )  # fmt: skip
    text = state(found)
    data = {
        "schema": "identifiability/study/benchmark_inside/1",
        "statement": text,
        "seed": seed,
        "versions": versions(),
        "closed": [vars(p) for p in closed],
        "pairs": [vars(p) | {"samples": n, "ratio": p.ratio, "agree": p.agree} for n, p in found],
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    print(text)
    print(write_json(out, data))
    print(
        write_page(
            "How fast, beside the naive form?", text, sections, out.with_suffix(".html"),
            overline="Benchmark", subtitle="3-RPS, trajectory 601, the paper's noise",
        )
    )  # fmt: skip


def main(argv: Sequence[str] | None = None) -> list[tuple[int, Pair]]:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        prog="benchmark_inside", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "benchmark_inside.json")
    parser.add_argument("--quick", action="store_true", help="750 samples and a tenth of the work")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    found = []
    with threadpool_limits(1):
        for samples, pair in pairs(quick=given.quick, seed=given.seed):
            print(
                f"{pair.name}, {samples} samples: {times_faster(pair.ratio)} times faster",
                flush=True,
            )
            found.append((samples, pair))
    write(found, paces(quick=given.quick), given.out, given.seed)
    return found


if __name__ == "__main__":
    main()
