"""Can a small joint be spoilt unnoticed, and how often is one called worse by chance?

Two logs of a six-axis arm, one to fit and one held out; the torque of the last joint, small
beside those of the others, has a constant offset that grows from row to row. A model with one
Coulomb level in both directions cannot have it. Pruning must keep what the joint needs, and
let no joint's held-out error rise. Beside it: how often pruning's test calls a joint worse where
two models are equally good.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.estimation.evidence import Evidence, Level, Score
from identifiability.foundation.numbers import Share, exact_share
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, random_trajectory, simulate
from identifiability.workflows.prune import prune

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

ROBOT, SAMPLES, NOISE = "six-dof-arm", 1500, Noise(additive=0.05, correlation=0.5)

#: Offsets of the last joint, in the rms of its torque. None must stay out from this one on.
OFFSETS, CLEAR = (0.0, 0.1, 0.2, 0.4), 0.2

#: A joint is spoilt if its held-out error against the torque without noise is so many times that
#: of the model that pruning starts from, and so large itself.
SPOILT, LARGE = 1.5, 0.05

#: Stretches and joints of the test by chance, and how heavy the tails of its differences are.
SHAPES, POWERS = ((16, 6), (20, 7), (16, 1)), (1, 3)

#: Squares of both models, large beside what they differ by.
FAR = 1000.0


@dataclass(frozen=True)
class Trial:
    """What one pruning did: arrays over the joints, of the model that it starts from and its own.

    `error`, `raw` and `rms` are those of the held-out log as it is told, `true` that against the
    torque without noise; `kept` says whether the last joint still has an offset.
    """

    offset: float
    kept: bool
    parameters: int
    error: np.ndarray
    raw: np.ndarray
    rms: np.ndarray
    true: np.ndarray

    @property
    def spoilt(self) -> bool:
        """Whether a joint errs more than it did."""
        before, after = self.true
        return bool(((after > SPOILT * before) & (after > LARGE)).any())


def make_logs(robot: Robot, offset: float, rng: np.random.Generator) -> tuple[Log, Log, np.ndarray]:
    """Return a log to fit and one to hold out, and the latter's torque without noise (N, n)."""
    logs = []
    for _ in range(2):
        wave = random_trajectory(robot, rng, period=SAMPLES / 100, samples=SAMPLES)
        clean = simulate(robot, PrescribedMotion.of(wave), noise=Noise(), rng=rng)
        shift = np.zeros(len(robot.joints))
        shift[-1] = offset * clean.tau[:, -1].std()
        exact = clean.tau + shift
        logs.append((replace(clean, tau=NOISE.on_torque(exact, rng)), exact))
    (fitted, _), (held, exact) = logs
    return fitted, held, exact


def try_offset(robot: Robot, offset: float, rng: np.random.Generator) -> Trial:
    """Return what pruning makes of logs with an offset of the last joint."""
    fitted, held, exact = make_logs(robot, offset, rng)
    ladder = prune(robot, fitted, held, replicates=0)
    last = robot.joints[-1]
    names = set(ladder.chosen.columns)
    kept = {f"{last}.Fc+", f"{last}.Fc-"} <= names or f"{last}.offset" in names
    values = np.stack(
        [r.submodel.expand(r.estimate.value) for r in (ladder.full, ladder.chosen)], 1
    )
    regression = ladder.structure.regression(ladder.validation)
    chunks = [c for part in regression.parts() for c in part.chunks()]
    W, tau, raw = (np.concatenate([getattr(c, k) for c in chunks]) for k in ("W", "tau", "raw"))
    predicted = W @ values
    t = np.concatenate([c.t for c in chunks])
    without = np.stack([np.interp(t, held.t, column) for column in exact.T], 1)
    scale = tau.std(0)[:, None]

    def error(torque: np.ndarray) -> np.ndarray:
        return np.sqrt(np.mean((torque[:, :, None] - predicted) ** 2, axis=0))

    return Trial(
        offset=offset,
        kept=kept,
        parameters=len(ladder.chosen),
        error=(error(tau) / scale).T,
        raw=(error(raw) / scale).T,
        rms=error(tau).T,
        true=(error(without) / scale).T,
    )


def share_text(share: Share) -> str:
    """Return ``2.0 % (0.1 … 8.9)``."""
    return f"{100 * share.value:.1f} % ({100 * share.low:.1f} … {100 * share.high:.1f})"


def offset_rows(trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
    """Yield one row an offset."""
    for offset in OFFSETS:
        own = [t for t in trials if t.offset == offset]
        kept = exact_share(sum(t.kept for t in own), len(own))
        spoilt = exact_share(sum(t.spoilt for t in own), len(own))
        row = {
            "offset of the last joint [its rms]": f"{offset:g}",
            "logs": str(len(own)),
            "offset kept": Check(
                share_text(kept), kept.value >= 0.9 if offset >= CLEAR else None, "at least 90 %"
            ),
            "a joint is spoilt": Check(share_text(spoilt), spoilt.value <= 0.1, "at most 10 %"),
        }
        for k, when in enumerate(("before", "after")):
            row |= {
                f"last joint, {when}": f"{100 * np.median([t.error[k, -1] for t in own]):.1f} %",
                f"raw, {when}": f"{100 * np.median([t.raw[k, -1] for t in own]):.1f} %",
                f"[N m], {when}": f"{np.median([t.rms[k, -1] for t in own]):.3g}",
            }
        yield row | {"parameters": f"{np.mean([t.parameters for t in own]):.1f}"}


def chance_rows(trials: int) -> Iterator[dict[str, Any]]:
    """Yield how often one of several joints is called worse where models are equally good."""
    rng = np.random.default_rng(1)
    for stretches, joints in SHAPES:
        for power in POWERS:
            rise = rng.normal(size=(trials, stretches, joints)) ** power
            base = Score.of_errors(np.full((stretches, joints), FAR), np.ones(joints), 0.0)
            called = [
                Level.WORSE
                in Evidence.of(Score.of_errors(FAR + x, np.ones(joints), 0.0), base).joint_levels
                for x in rise
            ]
            share = exact_share(sum(called), trials)
            yield {
                "stretches": str(stretches),
                "joints": str(joints),
                "tails": "normal" if power == 1 else "long",
                "called worse": Check(share_text(share), share.low <= 0.05, "at most 5 %"),
            }


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="small_joints", description=str(__doc__).split("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "small_joints.json")
    parser.add_argument("--quick", action="store_true", help="1 log of every offset, not 40")
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    count = 1 if given.quick else given.trials
    robot = Robot.load(ROBOT)
    streams = np.random.default_rng(given.seed).spawn(count)
    seeds = [s.bit_generator.seed_seq for s in streams]
    trials = [try_offset(robot, o, np.random.default_rng(s)) for s in seeds for o in OFFSETS]
    rows, chance = list(offset_rows(trials)), list(chance_rows(200 if given.quick else 5000))
    clear = [t for t in trials if t.offset >= CLEAR]
    kept, spoilt = (
        exact_share(sum(x), len(x)) for x in ([t.kept for t in clear], [t.spoilt for t in trials])
    )
    text = (
        f"An offset of {100 * CLEAR:g} % or more of the last joint's torque is kept in "
        f"{share_text(kept)} of {len(clear)} logs; pruning spoils a joint in {share_text(spoilt)} "
        f"of {len(trials)}."
    )
    print(text)
    method = (
        f"{ROBOT}, {SAMPLES} samples at 100 Hz, torque noise of {100 * NOISE.additive:g} % with a "
        f"correlation of {NOISE.correlation:g}; every log has a new random motion. Before: the "
        "model that pruning starts from; after: the model to use. Errors are medians on the "
        "held-out log, over the joint's own scale, of the torque that was fitted, of the torque as "
        f"it was measured, and in N m. A joint is spoilt if it errs {SPOILT:g} times as much "
        f"against the torque without noise, and more than {100 * LARGE:g} %. In brackets 95 % "
        "Monte-Carlo intervals."
    )
    sections = (
        Section(
            "offset", "An offset in the smallest joint", "", (frame_table(pd.DataFrame(rows)),)
        ),
        Section(
            "chance", "Called worse by chance", "Two models that are equally good.",
            (frame_table(pd.DataFrame(chance)),),
        ),
        Section("method", "Method", "", (Prose((method,)),)),
    )  # fmt: skip
    given.out.parent.mkdir(parents=True, exist_ok=True)
    result = {
        "schema": "identifiability/study/small-joints/1",
        "statement": text,
        "trials": count,
        "seed": given.seed,
        "offsets": [{k: getattr(v, "text", v) for k, v in row.items()} for row in rows],
        "chance": [{k: getattr(v, "text", v) for k, v in row.items()} for row in chance],
    }
    print(write_json(given.out, result))
    page = given.out.with_suffix(".html")
    print(write_page("Can a small joint be spoilt?", text, sections, page, overline="Study"))
    return result


if __name__ == "__main__":
    main()
