"""Does one proposed motion turn "A or B" into the true one?

Logs of poor motions (few harmonics) of a robot with one hidden effect are diagnosed until so many
diagnoses end in "A or B" with the truth among them. For each the next motion is asked for,
simulated with the same effect and noise, and the diagnosis goes on with it. Right is the
true name alone; the stated chance is held against how often that is so.

    python studies/next_experiment.py --commit $(git rev-parse HEAD) --out studies/results

The cases are drawn by the hash of the commit that is judged; every one is written as soon as it is
there, to `next_experiment.jsonl` in the folder `--out`, and the same command goes on.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from hidden_effect import read_rows
from hidden_effect_trials import judge
from scipy import stats

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import plain
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.simulation import Campaign, Noise, Trajectory, random_trajectory
from identifiability.workflows.diagnose import diagnose, find_next

ROBOTS = ("two-link", "five-bar", "six-dof-arm")
FAMILIES = (
    "stribeck_friction",
    "coulomb_asymmetry",
    "torque_offset",
    "quadratic_friction",
    "joint_stiffness",
    "load_dependent_friction",
    "position_ripple",
)
#: Harmonics of the motions there are, how many are fitted, and what is hidden, of the torque.
HARMONICS, FITTED, SHARES = (1, 2, 3), 2, (0.02, 0.05)
LEVEL, RHO, ENCODER = 0.012, 0.9, 2e-5
#: Looks of each search.
EVALUATIONS = 1500
#: Stated chances that are held together against what was achieved.
BINS = (0.0, 0.25, 0.5, 0.75, 0.9, 1.01)


class World:
    """A robot with a hidden effect, and logs of it; torque beside the model keeps its level."""

    def __init__(self, name: str, seed: int) -> None:
        rng = np.random.default_rng([seed, 17])
        self.robot, self.seed = Robot.load(name), seed
        self.family = FAMILIES[int(rng.integers(len(FAMILIES)))]
        self.joint = self.robot.joints[int(rng.integers(len(self.robot.joints)))]
        self.share = float(rng.choice(SHARES))
        count = int(rng.choice(HARMONICS))
        self.motions = [
            random_trajectory(self.robot, rng, harmonics=count) for _ in range(FITTED + 1)
        ]
        self.first = self._hidden(Campaign.of(self.robot, self.motions))

    def _hidden(self, campaign: Campaign) -> np.ndarray:
        return campaign.hidden([f"{self.family}@{self.joint}={self.share}"])

    def logs(self, more: Sequence[Trajectory] = ()) -> list[Log]:
        """Return a log of each motion; with more motions the first ones stay the same."""
        campaign = Campaign.of(self.robot, [*self.motions, *more])
        torque = self._hidden(campaign)
        old = torque[: len(self.first)]
        torque *= np.sqrt(np.sum(self.first**2) / np.sum(old**2))
        noise = Noise(additive=LEVEL, correlation=RHO, encoder=ENCODER)
        return campaign.logs(torque, noise, np.random.default_rng([self.seed, 77]))


def loop(name: str, seed: int) -> tuple[str, float, str, str]:
    """Return the outcome, the stated chance, and what was said before and after."""
    world = World(name, seed)
    logs = world.logs()
    options = {"forward": False, "quick": True, "seed": seed}
    d = diagnose(world.robot, logs[:FITTED], logs[FITTED:], **options)
    outcome, right = judge(d, {world.family}, {world.joint})
    if outcome != "A or B" or not right:
        return outcome, np.nan, "", ""
    said = f"{world.family}@{world.joint}: {'; '.join(e.names for e in d.effects)}"
    try:
        found = find_next(d, evaluations=EVALUATIONS, seed=seed)
    except IdentifiabilityError as error:
        return "no motion", np.nan, said, str(error)
    if found.same:
        return "the same torque", np.nan, "", ""
    logs = world.logs([found.excitation.trajectory] * found.periods)
    fitted = [*logs[:FITTED], *logs[FITTED + 1 :]]
    after = diagnose(world.robot, fitted, logs[FITTED : FITTED + 1], earlier=d, **options)
    outcome, right = judge(after, {world.family}, {world.joint})
    told = "; ".join(f"{e.names}@{'+'.join(e.joints)}" for e in after.effects) or "none"
    resolved = "right" if outcome == "exact" and right else f"then {outcome}"
    return resolved, found.chance, said, told


def case(name: str, seed: int) -> dict[str, Any]:
    """Return one robot and effect as a line of the file."""
    outcome, chance, said, told = loop(name, seed)
    asked = {"asked": bool(said), "said": said, "told": told}
    return {"robot": name, "seed": seed, "outcome": outcome, "chance": chance, **asked}


def tell(rows: Sequence[dict[str, Any]]) -> None:
    """Print how many were resolved, and the stated chance beside what was achieved."""
    asked = [r for r in rows if r["asked"]]
    print(f"{len(rows)} diagnoses; of those that no motion was asked for: "
          f"{dict(Counter(r['outcome'] for r in rows if not r['asked']))}")  # fmt: skip
    if not asked:
        return
    right = sum(r["outcome"] == "right" for r in asked)
    ci = stats.binomtest(right, len(asked)).proportion_ci()
    print(f"{right} of {len(asked)} resolved rightly ({ci.low:.2f} … {ci.high:.2f}): "
          f"{dict(Counter(r['outcome'] for r in asked))}")  # fmt: skip
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
        rows.append(plain(case(options.robots[len(rows) % len(options.robots)], seed)))
        if path is not None:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        if rows[-1]["asked"]:
            print(f"  {rows[-1]}", flush=True)
    tell(rows)


if __name__ == "__main__":
    main()
