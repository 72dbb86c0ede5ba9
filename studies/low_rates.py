"""Are values right where a log has few samples a second?

Arms drawn at random along random Fourier motions of up to half a hertz, positions and torque alone,
sampled at 10, 20, 50 and 100 Hz, with an encoder and noise of the torque. An oracle is given the
true velocities and accelerations with the same torque.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from drawn_robots import draw_arm
from threadpoolctl import threadpool_limits

from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.local import Serial
from identifiability.simulation import Noise, PrescribedMotion, random_trajectory, simulate
from identifiability.workflows.analyze import Analysis, analyze

RATES, KINDS = (10, 20, 50, 100), ("RR", "RP", "RRP", "PRR", "RRR")

#: Period and harmonics of the motion; seconds that are logged; noise of the torque beside each
#: joint's, and steps of the encoder [rad or m].
PERIOD, HARMONICS, SECONDS, TORQUE, STEP = 10.0, 5, 40.0, 0.03, 1e-5


def judge(found: Analysis) -> dict[str, int]:
    """Return how many values are called identifiable, and how many of these are wrong."""
    submodel = found.chosen.submodel
    truth = np.linalg.lstsq(submodel.M, found.structure.nominal_base - submodel.fixed, rcond=None)[
        0
    ]
    called, outside = 0, 0
    for verdict, true in zip(found.chosen.verdicts, truth, strict=True):
        if verdict.verdict is Class.IDENTIFIABLE:
            called += 1
            outside += abs(verdict.value - true) > 1.96 * verdict.sigma_robust
    return {"called": called, "outside": outside}


def run(
    rate: int, seed: int, folder: Path, share: float, seconds: float
) -> list[dict[str, object]]:
    """Return what came of one log, a row for either who analyzes it."""
    rng = np.random.default_rng([seed, 34])
    robot = draw_arm(rng, folder, KINDS[seed % len(KINDS)])
    wave = random_trajectory(robot, rng, period=PERIOD, harmonics=HARMONICS)
    t = np.arange(int(seconds * rate)) / rate
    motion = PrescribedMotion(t, *wave.motion(t * share))
    motion = replace(motion, dq=share * motion.dq, ddq=share**2 * motion.ddq)
    rng = np.random.default_rng([seed, rate])
    exact = simulate(robot, motion, noise=Noise(additive=TORQUE), rng=rng)
    log = replace(exact, q=Noise(encoder=STEP).on_encoder(exact.q), dq=None, ddq=None, sha256="")
    rows = []
    for who, given in (("the log", log), ("the oracle", exact)):
        found = analyze(robot, given, replicates=200, seed=seed, engine=Serial())
        hints = any("cut-off" in h for h in found.hints)
        rows.append({"rate": rate, "who": who, "seed": seed, "hint": hints} | judge(found))
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Run the study and print its table."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--robots", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--rates", type=int, nargs="+", default=list(RATES))
    parser.add_argument("--faster", type=float, default=1.0, help="so many times the speed")
    parser.add_argument("--seconds", type=float, default=SECONDS)
    given = parser.parse_args(arguments)
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder, threadpool_limits(1, "blas"):
        for rate in given.rates:
            for seed in range(given.first, given.first + given.robots):
                rows += run(rate, seed, Path(folder), given.faster, given.seconds)
            frame = pd.DataFrame([r for r in rows if r["rate"] == rate])
            print(rate, "Hz", flush=True)
            print(frame.groupby("who")[["called", "outside", "hint"]].sum(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
