"""What does one sample of a long log cost at each stage, beside what bounds the stage?

Processor time of one process, one thread, along a Parquet log of a six-dof arm with derivatives:
reading beside a copy in memory, the regressor beside a bare loop around Pinocchio, what is gathered
beside the matrix products that it takes. All are measured one after the other, the least of a few
times each, so that their ratios hold on a busy machine too.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pinocchio as pin
from long_logs import ROBOT, ROOT, write_log

from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.output import write_json
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import find_ladder, ladder_model
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.report import Section, frame_table, write_page
from identifiability.robot import Robot


@dataclass(frozen=True)
class Stage:
    """Processor time of a stage, and of what bounds it, on all samples together [s]."""

    name: str
    seconds: float
    limit: str
    bound: float


def least(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the least processor time of some work [s]."""
    found = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        found.append(time.process_time() - begin)
    return min(found)


def measure(path: Path) -> list[Stage]:
    """Return the stages that a log goes through, in their order."""
    robot = Robot.load(ROBOT)
    structure = Structure.of(robot, ladder_model(find_ladder(robot, None, beside=True).entry))
    file = LogFile.read(path)
    samples = prepare_log(robot, file, engine=Serial())
    table = np.random.default_rng(0).random((len(file), len(file.naming.columns)))
    copied = least(table.copy)
    reading = least(lambda: LogFile.read(path))
    decoding = least(lambda: sum(len(x) for x in file.table.parts(0, len(file))))
    surveying = least(lambda: prepare_log(robot, file, engine=Serial()))
    again = least(lambda: sum(len(p.tau) for s in samples.stretches for p in s.pieces(1024)))

    def regression() -> Regression:
        return structure.regression((samples,))

    regressors = least(lambda: sum(len(c[3]) for c in regression().chunks()))
    gathering = least(lambda: gather_information(regression(), engine=Serial()))
    return [
        Stage("first reading, with checks", reading, "decoding alone", decoding),
        Stage("decoding alone", decoding, "a copy in memory", copied),
        Stage("survey", surveying, "preparing alone", again),
        Stage("preparing for the fit", again, "decoding alone", decoding),
        Stage("regressor", regressors - again, "bare Pinocchio", bare(robot, regression())),
        Stage("gathering", gathering - regressors, "products alone", products(regression())),
        Stage("all", reading + surveying + gathering, "", float("nan")),
    ]


def bare(robot: Robot, regression: Regression) -> float:
    """Return the time of a loop around Pinocchio's regressor along the whole log [s]."""
    motion = regression.thin(1).samples[0].motion
    q, v, a = (np.ascontiguousarray(x) for x in (motion.q, motion.v, motion.a))
    data, find = robot.model.createData(), pin.computeJointTorqueRegressor

    def loop() -> None:
        for x, y, z in zip(q, v, a, strict=True):
            find(robot.model, data, x, y, z)

    return least(loop) * regression.outputs / len(q)


def products(regression: Regression) -> float:
    """Return the time of the products that turn rows into a basis and square them [s]."""
    W = next(iter(regression.chunks()))[2]
    seen = [int(W[:, a].any(0).sum()) + 1 for a in range(W.shape[1])]
    rng = np.random.default_rng(0)
    rows = [rng.standard_normal((len(W), k)) for k in seen]
    bases = [rng.standard_normal((k, k)) for k in seen]

    def square() -> None:
        for x, basis in zip(rows, bases, strict=True):
            z = x @ basis
            z.T @ z

    return least(square, 20) * regression.outputs / len(W)


def write(stages: Sequence[Stage], samples: int, out: Path) -> None:
    """Write the page and the numbers, and print where."""
    frame = pd.DataFrame(
        {
            "stage": s.name,
            "µs a sample": f"{1e6 * s.seconds / samples:.2f}",
            "limit": s.limit,
            "of it": f"{1e6 * s.bound / samples:.2f}" if s.limit else "",
            "times": f"{s.seconds / s.bound:.1f}" if s.limit else "",
        }
        for s in stages
    )
    text = f"{1e6 * stages[-1].seconds / samples:.1f} µs of processor time a sample."
    print(frame.to_string(index=False))
    data = {"schema": "identifiability/study/sample_stages/1", "statement": text}
    print(write_json(out, data | {"samples": samples, "stages": [vars(s) for s in stages]}))
    lead = "The regressor is made once for each sample; a log is read three times."
    section = Section("stages", "Stages", lead, (frame_table(frame),))
    page = out.with_suffix(".html")
    print(write_page("What does a sample cost?", text, (section,), page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> list[Stage]:
    """Run the study."""
    parser = argparse.ArgumentParser(
        prog="sample_stages", description=str(__doc__).partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "sample_stages.json")
    parser.add_argument("--samples", type=int, default=500_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder, one_thread("blas"):
        log = Path(folder) / "log.parquet"
        write_log(log, given.samples, given.seed, derivatives=True)
        stages = measure(log)
    write(stages, given.samples, given.out)
    return stages


if __name__ == "__main__":
    main()
