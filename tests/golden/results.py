"""Golden results: the JSON of every verb on the shipped robots, kept as numbers.

``python tests/golden/results.py write`` makes them anew, ``check`` holds today's results against
them, with ``--exact`` to the last bit (on the machine that wrote them), and ``--quick`` on two
robots only. A change of a golden result is a change of what users are told: say why in the commit.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import identifiability as ident
from identifiability import Robot, analyze, diagnose, excite, prune, simulate
from identifiability.foundation.output import plain
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory

HERE = Path(__file__).resolve().parent
SEEDS = (0, 1)
TRAJECTORIES = {"3-rps": ("601", "595")}
#: What is hidden from the diagnosis of each robot.
HIDDEN = {
    "3-rps": "stribeck_friction",
    "five-bar": "joint_stiffness",
    "six-dof-arm": "load_dependent_friction",
    "six-ups": "torque_offset",
    "two-link": "quadratic_friction",
}
ROBOTS, QUICK = tuple(HIDDEN), ("five-bar", "two-link")
NOISE = Noise(torque=0.03)

#: Keys whose values say where a result was made, not what it is,
#: or repeats, to be read back, what other keys tell (the fitted model).
UNTOLD = ("provenance", "seconds", "preparation", "fit")

#: What another processor may change: of each σ, of each other number, and of what was sampled
#: (processors round its chains apart) in standard deviations over the root of their ESS.
OF_SIGMA, OF_NUMBER, OF_SAMPLED = 1e-6, 1e-6, 8.0

#: Where an iteration ends by a tolerance of its own (the semidefinite program, fitted shapes and
#: orders, simulated motion), and how far apart processors end, of the largest number beside it.
SOLVED = {
    "physical", "physical_margin", "error_ra_physical", "real_robot", "error_ra_real_before",
    "error_ra_real_after", "forward", "noise", "effects", "after", "change", "unexplained", "steps",
}  # fmt: skip
OF_SOLVED = 0.01

#: A p-value counts simulated draws, about a hundred; rounding may turn a few that nearly tie.
OF_DRAWS = 0.03


def logs_of(robot: Robot, seed: int, count: int = 2, hide: list[str] | None = None) -> list[Any]:
    """Return simulated logs of a robot: short, with noise on the torque."""
    names = TRAJECTORIES.get(robot.name, ("a", "b"))
    rngs = np.random.default_rng(seed).spawn(count)
    out = []
    for k, rng in enumerate(rngs):
        motion = PrescribedMotion.of(shipped_trajectory(robot, names[k % len(names)]), 400)
        out.append(simulate(robot, motion, noise=NOISE, rng=rng, hide=hide or []))
    return out


def make(robot: Robot, verb: str, seed: int) -> dict[str, Any]:
    """Return the JSON of one verb."""
    if verb == "diagnose":
        logs = logs_of(robot, seed, hide=[f"{HIDDEN[robot.name]}=0.1"])
        found = diagnose(robot, logs[:1], logs[1:], seed=seed, quick=True)
        return json_of(found)
    if verb == "excite":
        return json_of(excite(robot, evaluations=200, samples=200, seed=seed))
    logs = logs_of(robot, seed)
    if verb == "prune":
        return json_of(prune(robot, logs[0], logs[1], replicates=20, seed=seed))
    posterior = verb == "analyze" and robot.name == "two-link"
    result = analyze(robot, logs[0], logs[1], replicates=200, posterior=posterior, seed=seed)
    if verb == "calibrate":
        from identifiability.workflows.calibrate.calibration import calibrate

        return json_of(calibrate(result, replicates=16, refits=50, names=0, seed=seed))
    return json_of(result)


VERBS = ("analyze", "prune", "diagnose", "calibrate", "excite")


def json_of(result: Any) -> dict[str, Any]:
    """Return what the result writes, without what another machine may say differently."""
    told = json.loads(json.dumps(plain(result.to_dict())))
    return {key: value for key, value in told.items() if key not in UNTOLD}


def cases(robots: tuple[str, ...], seeds: tuple[int, ...]) -> Iterator[tuple[str, str, int]]:
    """Give every (robot, verb, seed)."""
    for name in robots:
        for verb in VERBS:
            for seed in seeds:
                yield name, verb, seed


def stored(name: str, verb: str, seed: int) -> Path:
    """Return where a golden result is kept."""
    return HERE / f"{name}-{verb}-{seed}.json"


def differences(
    old: Any, new: Any, *, exact: bool, at: str = "", sigma: float = 0.0, room: float | None = None
) -> list[str]:
    """Return where two results differ by more than another processor may make them.

    Parameters
    ----------
    old, new
        Parsed JSON.
    exact : bool
        Whether the last bit counts.
    at : str
        Where in the result.
    sigma : float
        Standard deviation of the parameter whose row this is.
    room : float, optional
        How far apart numbers may be that an iteration found.
    """
    if room is not None:
        room = OF_SOLVED * _largest(old) if isinstance(old, (dict, list)) else room
    if isinstance(old, dict) and isinstance(new, dict):
        sigma = _sigma(old) or sigma
        lost = [f"{at}.{key}: only in one" for key in sorted(old.keys() ^ new.keys())]
        for key in sorted(old.keys() & new.keys()):
            if key == "posterior" and not exact:
                lost += _sampled(old[key], new[key])
            elif exact or key != "interval95" or old[key] == old.get("data_interval95", old[key]):
                wide = room
                if not exact and key in SOLVED:
                    wide = OF_SOLVED * _largest([old[key]])
                if not exact and key == "p_value":
                    wide = OF_DRAWS
                lost += differences(
                    old[key], new[key], exact=exact, at=f"{at}.{key}", sigma=sigma, room=wide
                )
        return lost
    if isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            return [f"{at}: {len(old)} and {len(new)} entries"]
        lost = []
        for k, (a, b) in enumerate(zip(old, new, strict=True)):
            here = f"{at}[{k}]"
            lost += differences(a, b, exact=exact, at=here, sigma=sigma, room=room)
        return lost
    if _number(old) and _number(new):
        apart = OF_NUMBER * max(abs(old), 1e-6) + OF_SIGMA * sigma  # else it is rounding
        apart = 0.0 if exact else max(apart, room or 0.0)
        return [] if abs(old - new) <= apart else [f"{at}: {old!r} and {new!r}"]
    if isinstance(old, str) and isinstance(new, str) and not exact:
        old, new = _words(old), _words(new)
    return [] if old == new else [f"{at}: {old!r} and {new!r}"]


def _largest(held: Any) -> float:
    """Return the largest size of the numbers that stand directly in a list or dictionary."""
    values = held.values() if isinstance(held, dict) else held
    return max((abs(v) for v in values if _number(v)), default=0.0)


def _words(text: str) -> str:
    """Return a sentence without its numbers, which are compared where they stand by themselves."""
    return re.sub(r"[\d.,·⁻⁰¹²³⁴-⁹e+−-]+", "#", text)


def _sampled(old: dict[str, Any] | None, new: dict[str, Any] | None) -> list[str]:
    """Return which posterior means and spreads differ by more than their Monte-Carlo error."""
    if not old or not new:
        return [] if old == new else ["posterior: only in one"]
    lost = []
    for kind in ("signs", "physical"):
        before, after = old[kind], new[kind]
        if (before is None) != (after is None):
            lost.append(f"posterior.{kind}: only in one")
        elif before and after and before["trustworthy"] and after["trustworthy"]:
            error = OF_SAMPLED / math.sqrt(min(before["ess"], after["ess"]))
            for a, b in zip(before["parameters"], after["parameters"], strict=True):
                off = max(abs(a["mean"] - b["mean"]), abs(a["sd"] - b["sd"])) / max(a["sd"], 1e-300)
                if a["name"] != b["name"] or off > error:
                    lost.append(f"posterior.{kind}.{a['name']}: {off:.2g} standard deviations")
    return lost


def _number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _sigma(row: dict[str, Any]) -> float:
    """Return σ of a parameter's row, in its unit; 0 where it has none."""
    percent, value = row.get("sigma_robust_percent"), row.get("value")
    if not (_number(percent) and _number(value)) or not math.isfinite(percent):
        return 0.0
    return abs(value) * percent / 100


def check(name: str, verb: str, seed: int, *, exact: bool = False) -> list[str]:
    """Return where today's result differs from the golden one."""
    old = json.loads(stored(name, verb, seed).read_text())
    return differences(old, make(Robot.load(name), verb, seed), exact=exact, at=verb)


def write(name: str, verb: str, seed: int) -> Path:
    """Write a golden result."""
    path = stored(name, verb, seed)
    text = json.dumps(make(Robot.load(name), verb, seed), sort_keys=True, indent=0)
    path.write_text(text + "\n")
    return path


def main() -> int:
    """Write or check all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("write", "check"))
    parser.add_argument("--exact", action="store_true")
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    print(f"identifiability {ident.__version__}")
    changed = 0
    for case in cases(QUICK if asked.quick else ROBOTS, SEEDS[:1] if asked.quick else SEEDS):
        if asked.what == "write":
            print(write(*case).name, flush=True)
            continue
        lost = check(*case, exact=asked.exact)
        changed += bool(lost)
        print(
            *case, "as before" if not lost else f"{len(lost)} differences: {lost[:5]}", flush=True
        )
    return int(changed > 0)


if __name__ == "__main__":
    sys.exit(main())
