"""Is one bad sample found and named, and does it leave the values where they were?

Faults are planted one at a time, at a random row of a random joint, in simulated logs with and
without derivatives: a torque × 1000, a torque × 10, a position one standard deviation off, a spike
of ten standard deviations in a velocity, and a burst of twelve samples of torque × 10, which is no
single sample and is left out of the fit. Values are compared with those of the log without the
fault, in its robust standard deviations. How often anything is said of logs without faults stands
beside it: simulated ones with noise of many kinds and coarse encoders, and real ones where they are
there.

Lost rows: of arms drawn at random along motions that are no series, up to a quarter of the rows is
left out at random, with the right time stamps. Positions and torque alone are analyzed; an oracle
is given the true motion at the rows that are left.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
import staubli_tx40
from drawn_robots import draw_arm
from real_data.study import ROOT, data_folder

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.uncertainty import resample
from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.mapping import Serial
from identifiability.foundation.numbers import exact_share
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.logs.mend import mend_logs
from identifiability.logs.prepare import Samples, prepare_samples
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.report import Check, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import (
    PAPER_NOISE,
    Noise,
    PrescribedMotion,
    random_trajectory,
    shipped_trajectory,
    simulate,
)
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.session import weigh_rows

ROBOTS = {"3-rps": "601", "five-bar": "a", "two-link": "a", "six-dof-arm": "a"}
MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
SAMPLES = 1000

NOISES = {
    "none": Noise(),
    "the paper's": PAPER_NOISE,
    "torque 5 %": Noise(torque=0.05),
    "additive, remembered": Noise(additive=0.05, correlation=0.95),
    "encoder 0.1 mrad": Noise(additive=0.02, encoder=1e-4),
    "encoder 1 mrad": Noise(additive=0.02, encoder=1e-3),
    "encoder 10 mrad": Noise(encoder=1e-2),
}

#: Noise of the logs in which faults are planted.
PLANTED = ("torque 5 %", "encoder 0.1 mrad", "the paper's")

#: Name → channel, samples, and what they become, from them and from the column's spread.
FAULTS: dict[str, tuple[str, int, Callable[[Any, float], Any]]] = {
    "torque × 1000": ("tau", 1, lambda x, sd: 1000 * x),
    "torque × 10": ("tau", 1, lambda x, sd: 10 * x),
    "position + 1 sd": ("q", 1, lambda x, sd: x + sd),
    "velocity + 10 sd": ("dq", 1, lambda x, sd: x + 10 * sd),
    "burst: 12 × torque × 10": ("tau", 12, lambda x, sd: 10 * x),
}


#: Lost rows: shares, arms, samples at 100 Hz (two thirds of a period of 30 s), harmonics of the
#: motion, noise of the torque beside each joint's and its correlation, steps of the encoder [rad or
#: m], and what must hold.
LOST, KINDS, LOGGED = (0.02, 0.05, 0.1, 0.25), ("RR", "RP", "RRP", "PRR", "RRR"), 2000
PERIOD, HARMONICS = 30.0, 12
TORQUE, RHO, STEP = 0.03, 0.8, 2e-5
MOST_OUTSIDE, LEAST_CALLED = 0.07, 0.8


@dataclass(frozen=True)
class Trial:
    """One planted fault.

    Attributes
    ----------
    fault, noise : str
    named : bool
        Whether log, row and column are said, or the stretch of a burst.
    before, after : float
        By how many robust standard deviations the value moves that moves most: if the fault
        stays, and as it is treated.
    """

    fault: str
    noise: str
    named: bool
    before: float
    after: float


def fit(
    structure: Structure, log: Log, *, treated: bool = True
) -> tuple[Samples, Information, Estimate, str]:
    """Return the prepared log, its information, the fit, and what is said of a stretch."""
    samples, wls = prepare_samples(structure.robot, log), find_estimator("wls")
    information = gather_information(structure.regression((samples,)))
    weighed, said, _ = weigh_rows(structure.robot.joints, (samples,), information, wls)
    information = weighed if treated else information
    return samples, information, wls.fit(information), said


def noisy(clean: Log, noise: Noise, rng: np.random.Generator, *, derivatives: bool) -> Log:
    """Return an exact log with noise."""
    assert clean.dq is not None
    assert clean.ddq is not None
    return replace(
        clean,
        q=noise.on_encoder(noise.on_motion(clean.q, rng)),
        tau=noise.on_torque(clean.tau, rng),
        dq=noise.on_motion(clean.dq, rng) if derivatives else None,
        ddq=noise.on_motion(clean.ddq, rng) if derivatives else None,
    )


def plant(log: Log, fault: str, rng: np.random.Generator) -> tuple[Log, int, str]:
    """Return the log with one fault, its row and its column."""
    channel, width, change = FAULTS[fault]
    values = getattr(log, channel).copy()
    row, joint = int(rng.integers(len(log) - width)), int(rng.integers(len(log.joints)))
    column = values[:, joint]
    column[row : row + width] = change(column[row : row + width], float(column.std()))
    return replace(log, **{channel: values}), row, f"{log.joints[joint]}.{channel}"


def try_faults(robot: Robot, clean: Log, draws: int, rng: np.random.Generator) -> Iterator[Trial]:
    """Yield the outcome of every fault in logs of a motion."""
    structure = Structure.of(robot, MODEL)
    for name in PLANTED:
        for derivatives in (True, False):
            log = noisy(clean, NOISES[name], rng, derivatives=derivatives)
            _, information, good, _ = fit(structure, log)
            sd = resample(information, good, 1.0, rng, 200).robust
            for fault in [f for f in FAULTS if derivatives or FAULTS[f][0] != "dq"]:
                for _ in range(draws):
                    bad, row, column = plant(log, fault, rng)
                    (mended,), hints = mend_logs([bad])
                    _, _, treated, said = fit(structure, mended)
                    raw = fit(structure, bad, treated=False)[2]
                    told = f"data row {row + 1} (" in (text := " ".join(hints)) and column in text
                    if FAULTS[fault][1] > 1:
                        told = bool(said)
                    moved = [float((np.abs(f.value - good.value) / sd).max())
                             for f in (raw, treated)]  # fmt: skip
                    yield Trial(fault, name, told, *moved)


def fault_frame(trials: Sequence[Trial]) -> pd.DataFrame:
    """Return one row a fault and a noise."""
    rows = []
    for fault, noise in product(FAULTS, PLANTED):
        own = [t for t in trials if (t.fault, t.noise) == (fault, noise)]
        before, after = (np.array([getattr(t, k) for t in own]) for k in ("before", "after"))
        missed = [t.after for t in own if not t.named]
        rows.append(
            {
                "fault": fault,
                "noise": noise,
                "planted": len(own),
                "named": share(sum(t.named for t in own), len(own)),
                "moves > 1 σ if it stays": share(int((before > 1).sum()), len(own)),
                "moves > 1 σ as treated": share(int((after > 1).sum()), len(own)),
                "median move if it stays [σ]": f"{np.median(before):.2g}",
                "median move as treated [σ]": f"{np.median(after):.2g}",
                "not named and > 1 σ": share(sum(m > 1 for m in missed), len(own)),
            }
        )
    return pd.DataFrame(rows)


def share(count: int, of: int) -> str:
    """Return a share in % with its Monte-Carlo standard error."""
    p = count / max(of, 1)
    return f"{100 * p:.1f} ± {100 * np.sqrt(p * (1 - p) / max(of, 1)):.1f} %"


def good_logs(robot: Robot, clean: Log, seeds: int) -> Iterator[Log]:
    """Yield logs without faults: the shipped motion and random ones, with noise of every kind."""
    motions = [clean]
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for period, samples in ((7.5, 750), (10.0, 2000)):
            wave = random_trajectory(robot, rng, period=period, samples=samples)
            motions.append(simulate(robot, PrescribedMotion.of(wave), noise=Noise(), rng=rng))
    for k, motion in enumerate(motions):
        for noise in NOISES.values():
            for derivatives in (True, False):
                rng = np.random.default_rng(k)
                yield noisy(motion, noise, rng, derivatives=derivatives)


def real_logs(folder: Path | None) -> Iterator[tuple[str, Robot, Log]]:
    """Yield runs 1 and 3 of the KUKA and two thirds of the TX40, where they are there."""
    kuka, tx40 = (data_folder(name, folder) for name in ("kuka_lwr4", "staubli_tx40"))
    if kuka.is_dir():
        arm = kuka_lwr4.load_robot(kuka)
        for run in (1, 3):
            yield f"KUKA run {run}", arm, kuka_lwr4.load_log(kuka, arm, run)
    if tx40.is_dir():
        arm = staubli_tx40.load_robot(tx40)
        log = staubli_tx40.load_log(tx40, arm)
        yield "TX40, two thirds", arm, log.rows(0, 2 * len(log) // 3)


def say(robot: Robot, log: Log) -> tuple[bool, bool]:
    """Return whether a sample of a log is called wrong, and whether a stretch decides."""
    (mended,), hints = mend_logs([log])
    return bool(hints), bool(fit(Structure.of(robot, MODEL), mended)[-1])


def judge(found: Analysis) -> tuple[int, int]:
    """Return how many values are called identifiable, and how many of them lie outside."""
    submodel = found.chosen.submodel
    truth = np.linalg.lstsq(submodel.M, found.structure.nominal_base - submodel.fixed, rcond=None)[
        0
    ]
    called = [
        v.interval95[0] <= true <= v.interval95[1]
        for v, true in zip(found.chosen.verdicts, truth, strict=True)
        if v.verdict is Class.IDENTIFIABLE
    ]
    return len(called), called.count(False)


def lose_rows(share: float, seed: int, folder: Path, replicates: int) -> tuple[int, ...]:
    """Return what came of a log without some rows: called and outside, of ours and the oracle."""
    rng = np.random.default_rng([seed, 5])
    robot = draw_arm(rng, folder, KINDS[seed % len(KINDS)])
    made = {"period": PERIOD, "samples": int(100 * PERIOD), "harmonics": HARMONICS}
    motion = random_trajectory(robot, rng, **made)
    clean = simulate(robot, PrescribedMotion.of(motion), noise=Noise(), rng=rng).rows(0, LOGGED)
    tau = Noise(additive=TORQUE, correlation=RHO).on_torque(clean.tau, rng)
    left = np.flatnonzero(rng.random(LOGGED) >= share)
    assert clean.dq is not None
    assert clean.ddq is not None
    rows = {"t": clean.t[left], "tau": tau[left], "sha256": ""}
    oracle = replace(clean, **rows, q=clean.q[left], dq=clean.dq[left], ddq=clean.ddq[left])
    log = replace(oracle, q=np.round(oracle.q / STEP) * STEP, dq=None, ddq=None)
    known = {"replicates": replicates, "seed": seed, "engine": Serial()}
    return (*judge(analyze(robot, log, **known)), *judge(analyze(robot, oracle, **known)))


def lost_frame(arms: int, first: int, replicates: int) -> pd.DataFrame:
    """Return one row a share of lost rows."""
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for share in LOST:
            tried = [lose_rows(share, first + k, Path(folder), replicates) for k in range(arms)]
            called, outside, known, wrong = np.sum(tried, axis=0).tolist()
            of = exact_share(float(outside), max(called, 1))
            text = f"{100 * of.value:.2g} % ({100 * of.low:.2g} … {100 * of.high:.2g})"
            row = {
                "lost": f"{100 * share:g} %",
                "arms": arms,
                "identifiable": called,
                "outside": Check(text, of.value <= MOST_OUTSIDE, "at most 7 %"),
                "of the oracle": known,
                "outside, oracle": wrong,
                "called beside the oracle": Check(
                    f"{called / max(known, 1):.3g}", called >= LEAST_CALLED * known, "at least .8"
                ),
            }
            print({k: v.text if isinstance(v, Check) else v for k, v in row.items()}, flush=True)
            out.append(row)
    return pd.DataFrame(out)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="bad_samples", description=str(__doc__).split("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "bad_samples.json")
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    parser.add_argument("--draws", type=int, default=10, help="faults of each kind a log")
    parser.add_argument("--seeds", type=int, default=5, help="random motions a robot, twice")
    parser.add_argument("--arms", type=int, default=40, help="drawn for each share of lost rows")
    parser.add_argument("--first", type=int, default=0, help="seed of the first arm")
    parser.add_argument("--replicates", type=int, default=200, help="of the bootstrap there")
    parser.add_argument("--only-lost", action="store_true", help="lost rows and nothing else")
    given = parser.parse_args(argv)
    lost = lost_frame(given.arms, given.first, given.replicates)
    if given.only_lost:
        return {}
    rng, trials, alarms, spent = np.random.default_rng(0), [], [], 0.0
    for name, trajectory in ROBOTS.items():
        robot = Robot.load(name)
        motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES)
        clean = simulate(robot, motion, noise=Noise(), rng=rng)
        trials += try_faults(robot, clean, given.draws, rng)
        begin = time.process_time()
        mend_logs([clean] * 20)
        spent = max(spent, (time.process_time() - begin) / 20)
        found = [say(robot, log) for log in good_logs(robot, clean, given.seeds)]
        alarms.append((name, len(found), *(sum(f[k] for f in found) for k in (0, 1))))
        print(alarms[-1], flush=True)
    for name, robot, log in real_logs(given.data):
        alarms.append((name, 1, *map(int, say(robot, log))))
        print(alarms[-1], flush=True)
    columns = ["logs without faults", "logs", "a sample is called wrong", "a stretch decides"]
    tables = fault_frame(trials), pd.DataFrame(alarms, columns=columns)
    single = [t for t in trials if FAULTS[t.fault][1] == 1]
    count, false = sum(a[1] for a in alarms), sum(a[2] + a[3] for a in alarms)
    named, moved, would = (
        share(sum(bad), len(single))
        for bad in zip(*((t.named, t.after > 1, t.before > 1) for t in single), strict=True)
    )
    text = (
        f"Of {len(single)} single bad samples {named} are named; {moved} move a value by more than "
        f"one robust standard deviation, {would} would. {false} of {count} logs without faults are "
        f"spoken of. Looking takes at most {1e3 * spent:.1f} ms for {SAMPLES} samples."
    )
    print(text)
    print(tables[0].to_string(index=False))
    lead = (
        "σ is the robust standard deviation of the log without the fault; ± Monte-Carlo errors. "
        "The paper's noise on positions (4 % of their value) is as large as what they span where "
        "joints slide far from zero: one standard deviation more is not seen there, and weighs "
        "nothing."
    )
    parts = [frame_table(t) for t in tables]
    sections = (
        Section("faults", "Planted faults", lead, (parts[0],)),
        Section("alarms", "Logs without faults", "How many are spoken of.", (parts[1],)),
        Section("lost", "Lost rows", "", (frame_table(lost),)),
    )
    given.out.parent.mkdir(parents=True, exist_ok=True)
    result = {
        "schema": "identifiability/study/bad_samples/1",
        "statement": text,
        "faults": tables[0].to_dict("records"),
        "without_faults": tables[1].to_dict("records"),
        "lost": lost.map(lambda x: x.text if isinstance(x, Check) else x).to_dict("records"),
    }
    print(write_json(given.out, result))
    page = given.out.with_suffix(".html")
    print(write_page("Does one bad sample decide?", text, sections, page, overline="Study"))
    return result


if __name__ == "__main__":
    main()
