"""Does one proposed motion turn "A or B", or "cannot be told", into the true name?

Each case is a robot with one hidden effect that its few poor motions (one to three harmonics, small
or as large as the robot allows) hardly tell from another: families and joints are drawn until the
dictionary has a rival at least `ALIKE` like the truth along these motions, or until the base model
says it as well. An effect that shows is about as large as leaves truth and rival undecided; one
that does not is a share of the torque. The laws' constants (a Stribeck speed, the length of a
ripple) are those of the first motions, so the truth is the same along the motion that is proposed.

Counted are the cases whose first diagnosis says "A or B" with the truth in it, or names nothing
where the truth is among what these logs cannot tell. For each one motion is asked for, simulated
with the same effect and noise, and the diagnosis goes on with it. Right is the true name at its
joint alone; the stated chance is held against how often that is so.

    python studies/next_experiment.py --commit $(git rev-parse HEAD) --out studies/results

The cases are drawn by the hash of the commit that is judged; every one is written as soon as it is
there, to `next_experiment.jsonl` in the folder `--out`, and the same command goes on.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from hidden_effect import read_rows
from hidden_effect_cases import resemble
from scipy import stats

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.output import plain
from identifiability.logs import Log
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import (
    Campaign,
    Noise,
    PrescribedMotion,
    Trajectory,
    random_trajectory,
)
from identifiability.workflows.diagnose import Diagnosis, Problem, Setting, diagnose, find_next
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.rows import Table
from identifiability.workflows.diagnose.workflow import usual_effects

ROBOTS = ("two-link", "five-bar", "six-dof-arm", "3-rps")
#: Harmonics and reach of the motions, how many are fitted; one more verifies.
HARMONICS, REACHES, FITTED = (1, 2, 3), (0.2, 0.5, 1.0), 2
#: Least similarity of truth and rival; range of the expected logarithm of their likelihood ratio,
#: of which 4 decides; and of the size of the truth in standard errors.
ALIKE, RATIO, STRENGTH = 0.93, (0.5, 2.0), (11.0, 20.0)
#: Size of what the base model says as well, of the joint's torque, and how many of the draws.
HIDDEN, ALIASED = 0.05, 0.4
NOISE = Noise(additive=0.012, correlation=0.9)
#: Encoders [rad, m].
ENCODER = (2e-5, 1e-6)
#: Looks of each search, and draws of a case.
EVALUATIONS, DRAWS = 700, 40
#: Stated chances that are held together against what was achieved.
BINS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.01)

#: Laws of speed over its rms along the first motions, position from home, place in their range from
#: −1 to 1, and load. Offset and asymmetric Coulomb friction are not among them: while a joint moves
#: they are one torque.
Law = Callable[[Array, Array, Array, Array], Array]
LAWS: dict[str, Law] = {
    "stribeck_friction": lambda v, _q, _at, _load: np.sign(v) * np.exp(-((v / 0.3) ** 2)),
    "rising_friction": lambda v, _q, _at, _load: -np.sign(v) * np.exp(-np.abs(v) / 0.3),
    "sigmoid_friction": lambda v, _q, _at, _load: np.tanh(v / 0.4),
    "quadratic_friction": lambda v, _q, _at, _load: np.abs(v) * v,
    "load_dependent_friction": lambda v, _q, _at, load: np.abs(load) * np.sign(v),
    "joint_stiffness": lambda _v, q, _at, _load: q,
    "position_ripple": lambda _v, _q, at, _load: np.sin(8 * np.pi * at),
}


class World:
    """A robot with a hidden effect and poor motions, drawn until its name can hardly be told."""

    def __init__(self, name: str, seed: int, only: str | None = None) -> None:
        rng = np.random.default_rng([seed, 17])
        self.robot, self.seed = Robot.load(name), seed
        aliased = bool(rng.random() < ALIASED) if only is None else only == "hidden"
        for _ in range(DRAWS):
            self.family, self.joint = (
                str(rng.choice(list(LAWS))),
                str(rng.choice(self.robot.joints)),
            )
            reach, count = float(rng.choice(REACHES)), int(rng.choice(HARMONICS))
            drawn = [random_trajectory(self.robot, rng, harmonics=count) for _ in range(FITTED + 1)]
            self.motions = [replace(m, sin=reach * m.sin, cos=reach * m.cos) for m in drawn]
            self.first = Campaign.of(self.robot, self.motions)
            self.torque = self._hidden(self.first)
            self.rival, self.similarity, strength = self._resemble()
            if aliased and not self.rival:
                return
            if not aliased and self.rival and self.similarity >= ALIKE and strength > 0:
                ratio = rng.uniform(*RATIO)
                size = np.sqrt(2 * ratio / max(1 - self.similarity**2, 1e-12))
                self.torque *= float(np.clip(size, *STRENGTH)) / strength
                return
        self.similarity = np.nan

    def _hidden(self, c: Campaign) -> Array:
        k, first = self.robot.joints.index(self.joint), self.first.move
        home = self.robot.actuated_positions(self.robot.home[None])[0][k]
        speed = float(np.sqrt(np.mean(first.dq[:, k] ** 2)))
        low, high = first.q[:, k].min(), first.q[:, k].max()
        at = (c.move.q[:, k] - (low + high) / 2) / ((high - low) / 2)
        force = LAWS[self.family](
            c.move.dq[:, k] / speed, c.move.q[:, k] - home, at, c.rigid.tau[:, k]
        )
        out = np.zeros_like(c.torque)
        out[:, k] = force
        scale = HIDDEN * np.sqrt(np.mean(self.first.torque[:, k] ** 2))
        if c is not self.first:
            old = force[: len(self.torque)]
            return out * float(self.torque[:, k] @ old) / float(old @ old)
        return out * scale / np.sqrt(np.mean(force**2))

    def logs(self, path: Trajectory | None = None, periods: int = 1) -> list[Log]:
        """Return a log of each motion; with one more the first ones stay the same."""
        c = repeat_last(self.robot, [*self.motions, path], periods) if path else self.first
        torque = self._hidden(c) if path else self.torque
        logs = c.logs(torque, NOISE, np.random.default_rng([self.seed, 77]))
        step = np.array([ENCODER[c.robot.is_prismatic(int(k))] for k in c.robot.actuated])
        return [replace(log, q=np.round(log.q / step) * step) for log in logs]

    def _resemble(self) -> tuple[str, float, float]:
        """Return the name most like the truth, how like, and the truth in standard errors.

        The name is empty where the base model says the truth as well, beside its own share.
        """
        names = [*LAWS, "torque_offset", "coulomb_asymmetry"]
        structure = Structure.of(self.robot, Model.of(*usual_effects(self.robot)))
        logs = self.logs()[:FITTED]
        samples = tuple(prepare_rows(self.robot, log, None) for log in logs)
        p = Problem(Setting(structure, samples), names)
        own_group = (self.family, self.joint)
        if any((a.family, a.place) == own_group and a.structural for a in p.aliases):
            return "", 1.0, np.nan
        bare, self.torque = self.torque, 0 * self.torque
        without = self.logs()[:FITTED]
        self.torque = bare
        taus = [
            Table.of(structure, [prepare_rows(self.robot, x, None) for x in part]).bare.tau
            for part in (logs, without)
        ]
        similar, size = resemble(p, taus[0] - taus[1])
        others = {group: own for group, own in similar.items() if group != own_group}
        (name, _), most = max(others.items(), key=lambda x: x[1], default=(("none", ""), 0.0))
        return name, most, size


def repeat_last(robot: Robot, motions: Sequence[Trajectory], periods: int) -> Campaign:
    """Return a campaign whose last motion is gone through several times.

    The torque of a period is that of every other one, so it is computed once.
    """
    c, path = Campaign.of(robot, motions), motions[-1]
    t = np.arange(periods * path.samples) * path.period / path.samples
    last = c.log == len(motions) - 1
    again = np.concatenate([np.flatnonzero(~last), np.tile(np.flatnonzero(last), periods)])
    begin = c.move.t[last][0]
    times = np.concatenate([c.move.t[~last], begin + t])
    return replace(
        c,
        moves=(*c.moves[:-1], PrescribedMotion(t, *path.motion(t), name=path.name)),
        move=PrescribedMotion(times, c.move.q[again], c.move.dq[again], c.move.ddq[again]),
        rigid=replace(c.rigid, **{name: x[again] for name, x in vars(c.rigid).items()}),
        torque=c.torque[again],
        log=c.log[again],
    )


def judge(d: Diagnosis, truth: tuple[str, str]) -> str:
    """Return the outcome in words; a name counts with its joint."""
    named = {(e.name, j) for e in d.effects for j in e.joints}
    if not named:
        hidden = {(a.family, a.place) for a in d.aliases if a.structural}
        return "cannot be told" if truth in hidden else "none"
    open_names = {
        (r.family, r.place) for e in d.effects for p in e.placements for r in p.rivals
        if r.undecided
    }  # fmt: skip
    if named == {truth}:
        return "A or B" if d.effects[0].alternatives else "exact"
    if len(named) == 1 and truth in open_names:
        return "A or B"
    return "truth and more" if truth in named else "wrong"


def tell_names(d: Diagnosis) -> str:
    """Return what a diagnosis names, in a line."""
    return "; ".join(f"{e.names}@{'+'.join(e.joints)}" for e in d.effects) or "none"


def case(name: str, seed: int, only: str | None = None) -> dict[str, Any]:
    """Return one robot and effect as a line of the file."""
    world = World(name, seed, only)
    truth = (world.family, world.joint)
    row: dict[str, Any] = {"robot": name, "seed": seed, "truth": "@".join(truth)}
    row |= {"rival": world.rival, "similarity": world.similarity, "asked": False, "chance": None}
    if np.isnan(world.similarity):
        return row | {"outcome": "not drawn"}
    logs = world.logs()
    options = {"forward": False, "quick": True, "seed": seed}
    d = diagnose(world.robot, logs[:FITTED], logs[FITTED:], **options)
    row |= {"first": judge(d, truth), "said": tell_names(d)}
    if row["first"] not in ("A or B", "cannot be told"):
        return row | {"outcome": row["first"]}
    try:
        found = find_next(d, evaluations=EVALUATIONS, seed=seed)
    except IdentifiabilityError as error:
        return row | {"outcome": "said to be told by no motion", "told": str(error)}
    row |= {"asked": True, "said": f"{row['said']}; asked: {found.statement[:160]}"}
    row |= {"chance": found.chance, "periods": found.periods, "separates": list(found.names)}
    row["seconds"] = found.periods * found.excitation.trajectory.period
    shown = any(n.partition(":")[0] == "@".join(truth) for n in found.names)
    if found.same or not shown:
        return row | {"asked": False, "outcome": "said to be told by no motion"}
    *old, new = world.logs(found.excitation.trajectory, found.periods)
    after = diagnose(world.robot, [*old[:FITTED], new], old[FITTED:], **options)
    outcome = judge(after, truth)
    row["told"] = tell_names(after)
    return row | {"outcome": "right" if outcome == "exact" else f"then {outcome}"}


def tell(rows: Sequence[dict[str, Any]]) -> None:
    """Print how many were resolved, and the stated chance beside what was achieved."""
    asked = [r for r in rows if r["asked"]]
    print(f"{len(rows)} diagnoses; of those that no motion was asked for: "
          f"{dict(Counter(r['outcome'] for r in rows if not r['asked']))}")  # fmt: skip
    for part in ("A or B", "cannot be told"):
        own = [r for r in asked if r["first"] == part]
        if own:
            right = sum(r["outcome"] == "right" for r in own)
            ci = stats.binomtest(right, len(own)).proportion_ci()
            print(f"{part}: {right} of {len(own)} resolved rightly ({ci.low:.2f} … {ci.high:.2f}): "
                  f"{dict(Counter(r['outcome'] for r in own))}")  # fmt: skip
    known = [r for r in asked if r["chance"] is not None and np.isfinite(r["chance"])]
    for low, high in pairwise(BINS):
        part = [r for r in known if low <= r["chance"] < high]
        if part:
            stated, count = np.mean([r["chance"] for r in part]), len(part)
            good = sum(r["outcome"] == "right" for r in part)
            print(f"  stated {low:.2f} … {high:.2f} (mean {stated:.2f}): {good} of {count} right")


def main(argv: Sequence[str] | None = None) -> None:
    """Run cases until so many were asked, and print what became of them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", type=int, default=40, help="motions that are asked for")
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    parser.add_argument("--only", choices=("rivals", "hidden"), help="all cases of one kind")
    parser.add_argument("--commit", default="0", help="its hash draws the cases; hexadecimal")
    parser.add_argument("--out", type=Path, default=None, help="folder; goes on where it stopped")
    options = parser.parse_args(argv)
    path = None
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        path = options.out / "next_experiment.jsonl"
    rows = read_rows(path)
    first = int(options.commit[:7], 16)
    while sum(r["asked"] for r in rows) < options.cases:
        seed = first + len(rows)
        rows.append(
            plain(case(options.robots[len(rows) % len(options.robots)], seed, options.only))
        )
        if path is not None:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        print(f"  {rows[-1]}", flush=True)
    tell(rows)


if __name__ == "__main__":
    main()
