"""Golden results: the JSON of every verb, each on another shipped robot, kept as numbers.

``python tests/golden/results.py write`` makes them anew, ``check`` holds today's results against
them, with ``--exact`` to the last bit (on the machine that wrote them). A change of a golden result
is a change of what users are told: say why in the commit.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identifiability import (
    Robot,
    analyze,
    calibrate,
    compare,
    diagnose,
    excite,
    payload,
    prune,
    simulate,
)
from identifiability.foundation.output import plain
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory

HERE = Path(__file__).resolve().parent
#: Each verb, and its robot.
VERBS = {
    "analyze": "two-link",
    "prune": "3-rps",
    "diagnose": "five-bar",
    "calibrate": "two-link",
    "excite": "six-ups",
    "payload": "six-dof-arm",
    "compare": "six-dof-arm",
}
TRAJECTORIES = {"3-rps": ("601", "595")}
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


def logs_of(robot: Robot, hide: Sequence[str] = ()) -> list[Any]:
    """Return two simulated logs of a robot: short, with noise on the torque."""
    rngs = np.random.default_rng(0).spawn(2)
    names = TRAJECTORIES.get(robot.name, ("a", "b"))
    motions = [PrescribedMotion.of(shipped_trajectory(robot, name), 400) for name in names]
    return [
        simulate(robot, motion, noise=NOISE, rng=rng, hide=[*hide])
        for motion, rng in zip(motions, rngs, strict=True)
    ]


def make(verb: str) -> dict[str, Any]:
    """Return the JSON of one verb."""
    robot = Robot.load(VERBS[verb])
    if verb == "excite":
        return json_of(excite(robot, evaluations=200, samples=200))
    if verb == "diagnose":
        logs = logs_of(robot, hide=["joint_stiffness=0.1"])
        return json_of(diagnose(robot, logs[:1], logs[1:], quick=True))
    fitted, unseen = logs_of(robot)
    if verb == "prune":
        return json_of(prune(robot, fitted, unseen, replicates=20))
    if verb == "compare":
        return json_of(compare(robot, fitted, unseen))
    if verb == "payload":
        return json_of(payload(robot, analyze(robot, fitted, replicates=20), unseen))
    result = analyze(robot, fitted, unseen, replicates=200, posterior=verb == "analyze")
    return json_of(result if verb == "analyze" else calibrate(result, replicates=16, refits=50))


def json_of(result: Any) -> dict[str, Any]:
    """Return what the result writes, without what another machine may say differently."""
    told = json.loads(json.dumps(plain(result.to_dict())))
    return {key: value for key, value in told.items() if key not in UNTOLD}


def stored(verb: str) -> Path:
    """Return where a golden result is kept."""
    return HERE / f"{verb}.json"


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
    for kind in ("physical",):
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


def check(verb: str, *, exact: bool = False) -> list[str]:
    """Return where today's result differs from the golden one."""
    return differences(json.loads(stored(verb).read_text()), make(verb), exact=exact, at=verb)


def main() -> int:
    """Write or check all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("write", "check"))
    parser.add_argument("--exact", action="store_true")
    asked = parser.parse_args()
    changed = 0
    for verb in VERBS:
        if asked.what == "write":
            text = json.dumps(make(verb), sort_keys=True, indent=0)
            stored(verb).write_text(text + "\n")
            continue
        lost = check(verb, exact=asked.exact)
        changed += bool(lost)
        print(verb, "as before" if not lost else f"{len(lost)} differences: {lost[:5]}", flush=True)
    return int(changed > 0)


if __name__ == "__main__":
    sys.exit(main())
