"""Does one proposed motion turn "A or B" into the true one?

Logs of poor motions (few harmonics) of a robot with one hidden effect are diagnosed until so many
diagnoses end in "A or B" with the truth among them. For each the next motion is asked for,
simulated with the same effect and noise, and diagnosed with the logs there were. Right is the
true name alone; the stated chance is held against how often that is so.

``python studies/next_experiment.py [CASES] [ROBOT…]``
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence

import numpy as np
from hidden_effect_trials import judge
from scipy import stats

from identifiability.foundation.errors import IdentifiabilityError
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
    after = diagnose(world.robot, fitted, logs[FITTED : FITTED + 1], **options)
    outcome, right = judge(after, {world.family}, {world.joint})
    told = "; ".join(f"{e.names}@{'+'.join(e.joints)}" for e in after.effects) or "none"
    resolved = "right" if outcome == "exact" and right else f"then {outcome}"
    return resolved, found.chance, said, told


def main(cases: int, robots: Sequence[str] = ROBOTS) -> None:
    """Print one line a case, and how many were resolved."""
    outcomes, chances, first = Counter[str](), [], Counter[str]()
    seed = 0
    while sum(outcomes.values()) < cases:
        name = robots[seed % len(robots)]
        outcome, chance, said, told = loop(name, seed)
        seed += 1
        if not said:
            first[outcome] += 1
            continue
        outcomes[outcome] += 1
        chances.append((chance, outcome == "right"))
        print(f"  {name}, seed {seed - 1}: {said} → {told} ({chance:.2f}): {outcome}", flush=True)
    right = outcomes["right"]
    ci = stats.binomtest(right, cases).proportion_ci()
    print(f"{seed} diagnoses; of those that no motion was asked for: {dict(first)}")
    print(f"{right} of {cases} resolved rightly ({ci.low:.2f} … {ci.high:.2f}): {dict(outcomes)}")
    known = [c for c, _ in chances if np.isfinite(c)]
    print(f"stated chance, mean: {np.mean(known):.2f}")


if __name__ == "__main__":
    words = sys.argv[1:]
    count = int(words.pop(0)) if words and words[0].isdigit() else 40
    main(count, words or ROBOTS)
