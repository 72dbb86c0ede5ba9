"""Is nothing named where kept values are wrong by no more than they are known to be?

Nothing is hidden. Either every value of the robot is off by a share of it, drawn anew in each
trial, and the diagnosis is told that share; or the values are those that `analyze` found from
three other logs with their own noise, and the diagnosis is told their covariance. Beside both a
payload of a tenth of the robot's mass is hidden, which must be named, with its mass.

``python studies/fixed_values.py [TRIALS] [ROBOT…]``
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import cache

import numpy as np
from hidden_effect_trials import BASE_EFFECTS, campaign, simulated
from scipy import stats

from identifiability.effects.rigid_body import last_bodies
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.model import Model
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze import analyze
from identifiability.workflows.diagnose import Diagnosis, diagnose
from identifiability.workflows.diagnose.known_values import share_spread

ROBOTS, HOW = ("five-bar", "3-rps", "six-dof-arm"), ("share", "result", "payload")
#: Where a payload is no tenth of a moved body.
LOADED = ("six-dof-arm",)
#: How far the values may be off.
SHARE = 0.1


@cache
def _structure(name: str) -> Structure:
    return Structure.of(campaign(name).robot, Model.of(*BASE_EFFECTS))


@cache
def _columns(name: str) -> Array:
    """Return the columns of all standard parameters along the noiseless motions, (N, n, p)."""
    c = campaign(name)
    logs = c.logs(derivatives=True)
    samples = [prepare_samples(c.robot, log, Preparation(keep_rest=True)) for log in logs]
    model = Model.of(*BASE_EFFECTS)
    return np.concatenate([model.regressor(c.robot, s.motion) for s in samples])


def off(name: str, seed: int) -> Array:
    """Return the torque (N, n) of values that are off by the share."""
    spread = share_spread(SHARE, _structure(name))
    drawn = np.random.default_rng([seed, 5]).standard_normal(len(spread))
    torque: Array = _columns(name) @ (spread * drawn)
    return torque


def payload(name: str) -> tuple[Array, float]:
    """Return the torque (N, n) of a point mass at the origin of the last body, and its mass."""
    structure = _structure(name)
    masses = [(v, k) for k, v in structure.robot.nominal.items() if k.endswith(".m")]
    mass = 0.1 * sum(v for v, _ in masses)
    body = last_bodies(structure.robot)[-1]
    return _columns(name)[:, :, structure.columns.index(f"{body}.m")] * mass, mass


def trial(name: str, how: str, seed: int) -> Diagnosis:
    """Diagnose five logs with values kept."""
    robot = campaign(name).robot
    torque = off(name, seed)
    if how == "payload":
        torque = torque + payload(name)[0]
    if how == "result":
        torque = np.zeros_like(torque)
        before: list[Log] = simulated(name, torque, seed + 10_000)
        given = analyze(robot, before[:3], replicates=200, seed=seed).fit
    logs = simulated(name, torque, seed)
    return diagnose(
        robot,
        logs[:4],
        logs[4:],
        fixed=given if how == "result" else SHARE,
        quick=True,
        forward=False,
        seed=seed,
    )


def main(trials: int, robots: Sequence[str] = ROBOTS, ways: Sequence[str] = HOW) -> None:
    """Print one line a trial with a name, and one for every robot and way."""
    for how in ways:
        pooled, every = 0, 0
        for name in (r for r in robots if how != "payload" or r in LOADED):
            named = held = first = 0
            for seed in range(trials):
                d = trial(name, how, seed)
                named += bool(d.effects) if how != "payload" else _found(d)
                if how == "payload":
                    first += any(e.name == "payload" for e in d.effects)
                    held += _holds(d, payload(name)[1])
                elif d.effects:
                    said = "; ".join(f"{e.name}@{'+'.join(e.joints)}" for e in d.effects)
                    print(f"  {name} {how}, seed {seed}: {said}", flush=True)
            pooled, every = pooled + named, every + trials
            _say(name, how, named, trials)
            if how == "payload":
                print(f"  its mass within 1.96 standard errors in {held} of {first} so named")
        _say("all robots", how, pooled, every)


def _found(d: Diagnosis) -> bool:
    return any("payload" in (e.name, *e.alternatives) for e in d.effects)


def _holds(d: Diagnosis, mass: float) -> bool:
    rows = [r for e in d.effects for p in e.placements for r in p.rows]
    return any(n.endswith("payload_m") and abs(v - mass) < 1.96 * s for n, v, s, _ in rows)


def _say(name: str, how: str, count: int, trials: int) -> None:
    ci = stats.binomtest(count, trials).proportion_ci()
    what = "with the payload named" if how == "payload" else "given a name"
    print(f"{name}, {how}: {count} of {trials} {what} ({ci.low:.3f} … {ci.high:.3f})", flush=True)


if __name__ == "__main__":
    words = sys.argv[1:]
    count = int(words.pop(0)) if words and words[0].isdigit() else 100
    chosen = [w for w in words if w not in HOW]
    main(count, chosen or ROBOTS, [w for w in words if w in HOW] or HOW)
