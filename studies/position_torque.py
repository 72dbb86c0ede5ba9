"""Is torque that depends on a position learned, and is none named where there is none?

A cable (a curve without an equation, steep at one end) or an extension spring between two pivots is
planted in one joint; five random motions, torque noise with correlation .9. Learned is what leaves
at most 1.1 × the held-out error of the true model. Nothing planted: the share of false names.

    python studies/position_torque.py [SEEDS] [ROBOT ...] [cable | spring | nothing ...]
"""

from __future__ import annotations

import sys

import numpy as np
from hidden_effect_trials import campaign, simulated, true_error
from scipy import stats

from identifiability.workflows.diagnose import Diagnosis, diagnose

#: Size of what is planted: its rms over that of the joint's torque.
SIZE = 0.1
#: Held-out error over the true model's up to which a curve is learned.
LEARNED = 1.1
ROBOTS = ("six-dof-arm", "five-bar")
PLANTED = ("cable", "spring", "nothing")


def curve(what: str, q: np.ndarray) -> np.ndarray:
    """Return a torque over position (N,), without scale."""
    u = 2 * (q - q.min()) / np.ptp(q) - 1  # from end to end
    if what == "cable":
        return 0.3 * u + np.exp(3 * (u - 1)) - 0.4 * np.tanh(3 * (u + 0.4))
    # A spring of free length 0.8 between pivots at 1 and 0.5 from the joint: over its dead centre.
    angle = 1.2 * u + 0.5
    length = np.sqrt(1 + 0.25 + np.cos(angle))
    return (1 - 0.8 / length) * 0.5 * np.sin(angle)


def plant(name: str, what: str, joint: int) -> np.ndarray:
    """Return the planted torque along all motions, (N, n)."""
    source = campaign(name)
    out = np.zeros_like(source.torque)
    if what != "nothing":
        force = curve(what, source.move.q[:, joint])
        rms = np.sqrt(np.mean(source.torque[:, joint] ** 2))
        out[:, joint] = force * SIZE * rms / np.sqrt(np.mean((force - force.mean()) ** 2))
    return out


def trial(name: str, what: str, seed: int) -> tuple[Diagnosis, float, str]:
    """Return a diagnosis, its held-out error over the true model's, and the joint."""
    robot = campaign(name).robot
    joint = seed % len(robot.joints)
    logs = simulated(name, plant(name, what, joint), seed)
    d = diagnose(robot, logs[:4], logs[4:], seed=seed, forward=False)
    return d, d.held_after / true_error(name, seed), robot.joints[joint]


def main(seeds: int, robots: tuple[str, ...], planted: tuple[str, ...]) -> None:
    """Print one line a trial and one for every robot and curve."""
    for name in robots:
        for what in planted:
            good, named = 0, 0
            for seed in range(seeds):
                d, ratio, joint = trial(name, what, seed)
                good += ratio <= LEARNED
                named += bool(d.effects)
                said = "; ".join(f"{e.name}@{'+'.join(e.joints)}" for e in d.effects)
                print(
                    f"  {name} {what} in {joint}, seed {seed}: ε {100 * d.held_before:.3g} → "
                    f"{100 * d.held_after:.3g} %, {ratio:.3f} × the true model's; {said or 'none'}",
                    flush=True,
                )
            count = named if what == "nothing" else good
            ci = stats.binomtest(count, seeds).proportion_ci()
            word = "given a false name" if what == "nothing" else "learned"
            print(
                f"{name}, {what}: {count} of {seeds} {word} (95 %: {ci.low:.2f} … {ci.high:.2f})",
                flush=True,
            )


if __name__ == "__main__":
    words = sys.argv[1:]
    count = int(words.pop(0)) if words and words[0].isdigit() else 30
    robots = tuple(w for w in words if w not in PLANTED) or ROBOTS
    main(count, robots, tuple(w for w in words if w in PLANTED) or PLANTED)
