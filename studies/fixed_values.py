"""Is nothing named where kept values are wrong by no more than they are known to be?

Nothing is hidden. Either every value of the robot is off by a share of it, drawn anew in each
trial, and the diagnosis is told that share; or the values are those that `analyze` found from
three other logs with their own noise, and the diagnosis is told their covariance. Beside both a
payload of a tenth of the robot's mass is hidden, which must be named, with its mass.

    python studies/fixed_values.py --trials 100 --robots five-bar --how share --out studies/results

Every trial is written as soon as it is there, to `fixed_values.jsonl` in the folder `--out`; the
same command goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hidden_effect import read_rows
from hidden_effect_trials import BASE_EFFECTS, ENCODER, campaign, simulated
from scipy import stats

from identifiability.effects.inertia import last_bodies
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.regression import Model
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


def row_of(name: str, how: str, seed: int) -> dict[str, Any]:
    """Return one trial as a line of the file."""
    d = trial(name, how, seed)
    row = {"robot": name, "how": how, "seed": seed, "named": bool(d.effects)}
    row["said"] = "; ".join(f"{e.names}@{'+'.join(e.joints)}" for e in d.effects)
    if how == "payload":
        row["named"] = any("payload" in (e.name, *e.alternatives) for e in d.effects)
        masses = [
            (float(value), float(error))
            for e in d.effects
            for p in e.placements
            for parameter, value, error, _ in p.rows
            if parameter.endswith("payload_m")
        ]
        row |= {"mass": payload(name)[1], "masses": masses}
    return row


def tell(rows: Sequence[dict[str, Any]], how: str, name: str) -> None:
    """Print how many of some trials were given a name, with its 95 % interval."""
    if not rows:
        return
    count = sum(r["named"] for r in rows)
    ci = stats.binomtest(count, len(rows)).proportion_ci()
    what = "with the payload named" if how == "payload" else "given a name"
    print(f"{name}, {how}: {count} of {len(rows)} {what} ({ci.low:.3f} … {ci.high:.3f})")
    if how == "payload":
        held = [abs(v - r["mass"]) < 1.96 * s for r in rows for v, s in r["masses"]]
        print(f"  its mass within 1.96 standard errors in {sum(held)} of {len(held)}")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the trials that are missing, and print what became of all."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=100, help="a robot and way")
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS), choices=ENCODER)
    parser.add_argument("--how", nargs="*", default=list(HOW), choices=HOW)
    parser.add_argument("--out", type=Path, default=None, help="folder; goes on where it stopped")
    options = parser.parse_args(argv)
    path = None
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        path = options.out / "fixed_values.jsonl"
    rows = read_rows(path)
    done = {(r["robot"], r["how"], r["seed"]) for r in rows}
    cells = [
        (name, how)
        for how in options.how
        for name in options.robots
        if how != "payload" or name in LOADED
    ]
    for job in ((*cell, seed) for seed in range(options.trials) for cell in cells):
        if job in done:
            continue
        rows.append(row_of(*job))
        if path is not None:
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        if rows[-1]["said"]:
            print(f"  {job[0]} {job[1]}, seed {job[2]}: {rows[-1]['said']}", flush=True)
    for how in options.how:
        own = [r for r in rows if r["how"] == how]
        for name in options.robots:
            tell([r for r in own if r["robot"] == name], how, name)
        tell(own, how, "all robots")


if __name__ == "__main__":
    main()
