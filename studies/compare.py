"""Does `compare` keep its level on a robot that did not change, and find friction that rose?

Four robots, two logs each: of the same motion, and of two motions. Nothing changes in the first
half of the comparisons; in the others the friction of one joint, drawn at random, is 20 % higher
in the second log. On the six-axis arm, a load of .6 kg as well, drawn at random in shape and place,
on two motions. Noise: encoders that are rounded, torque with autocorrelated errors. Beside them,
runs 1 and 3 of a real arm, where the data are there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
from planted_load import PlantedLoad, unit_loads
from real_data.study import data_folder
from threadpoolctl import threadpool_limits

from identifiability import Robot, compare
from identifiability.foundation.numbers import exact_share
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.simulation import Noise, shipped_trajectory
from identifiability.simulation.forces import joint_torque
from identifiability.simulation.simulator import Campaign

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: Two motions of each robot, and resolution of its encoders [rad or m].
ROBOTS = {
    "two-link": (("a", "b"), 1e-5),
    "five-bar": (("a", "b"), 1e-5),
    "3-rps": (("601", "595"), 1e-6),
    "six-dof-arm": (("a", "b"), 1e-5),
}

#: Torque noise as a share of each joint's rms, and its correlation from sample to sample.
SIZE, RHO = 0.02, 0.8

#: By how much friction rises.
RISE = 0.2

#: The load [kg].
LOAD = 0.6

#: What must hold.
MOST_FALSE, LEAST_FOUND = 0.10, 0.90

MOTIONS = ("same motion", "other motion")
MOST_FALSE_LOADS, LEAST_LOADS = 1, 0.96


def measure(name: str, trials: int) -> list[dict[str, Any]]:
    """Return one row a comparison."""
    robot = Robot.load(name)
    motions, step = ROBOTS[name]
    campaign = Campaign.of(robot, [shipped_trajectory(robot, m) for m in motions])
    noise = Noise(additive=SIZE, correlation=RHO, encoder=step)
    rows = []
    for trial in range(trials):
        rng = np.random.default_rng([trial, len(name)])
        joint = str(rng.choice(robot.joints))
        first = _logs(campaign, noise, rng, "before")
        for changed in (False, True):
            robot_now = _with_friction(campaign, joint) if changed else campaign
            second = _logs(robot_now, noise, rng, "after")
            for motion, log in zip(MOTIONS, second, strict=True):
                found = compare(robot, first[0], log)
                causes = [c.cause for c in found.changes]
                named = any(c.kind == "friction" and c.place == joint for c in causes)
                share = [c.share for c in found.changes if c.cause.place == joint]
                rows.append(
                    {
                        "robot": name,
                        "trial": trial,
                        "motion": motion,
                        "changed": changed,
                        "said": bool(causes),
                        "found": named,
                        "others": len(causes) - named,
                        "share": share[0] if named else float("nan"),
                        "kind": found.difference.kind,
                    }
                )
    print(name, trials, flush=True)
    return rows


def measure_loads(trials: int, seed: int) -> dict[str, int]:
    """Return in how many pairs of logs of two motions a load is found, and where none is."""
    robot = Robot.load("six-dof-arm")
    campaign = Campaign.of(robot, [shipped_trajectory(robot, k) for k in ("a", "b")])
    unit = unit_loads(campaign, robot.bodies[-1])
    noise = Noise(additive=SIZE, correlation=RHO, encoder=1e-5)
    count = {"pairs": trials, "a change is said": 0, "the load is found": 0}
    for trial in range(trials):
        rng = np.random.default_rng([seed, trial, 7])
        planted = PlantedLoad.draw(LOAD, rng)
        base, bare = campaign.logs((), noise, rng)
        _, loaded = campaign.logs(unit @ planted.parameters, noise, rng)
        count["a change is said"] += bool(compare(robot, base, bare).changes)
        found = compare(robot, base, loaded).changes
        count["the load is found"] += any(c.cause.kind == "load" for c in found)
    print(count, flush=True)
    return count


def _logs(campaign: Campaign, noise: Noise, rng: np.random.Generator, when: str) -> list[Log]:
    logs = campaign.logs((), noise, rng)
    return [replace(log, name=f"{log.name} {when}") for log in logs]


def _with_friction(campaign: Campaign, joint: str) -> Campaign:
    """Return the same motions of a robot with more friction in one joint."""
    robot = campaign.robot
    values = dict(robot.nominal)
    for name in values:
        if name.rpartition(".")[0] == joint and name.rpartition(".")[2] in (
            "Fv",
            "Fc",
            "Fc+",
            "Fc-",
        ):
            values[name] *= 1 + RISE
    added = joint_torque(robot, campaign.move, campaign.rigid, values)
    return replace(campaign, torque=campaign.rigid.tau + added)


def summary(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row a motion, over all robots, and one a robot and motion; asked of the former."""
    rows = []
    every = [("all", frame), *frame.groupby("robot", sort=False)]
    for robot, part in every:
        for motion, own in part.groupby("motion", sort=False):
            null, changed = own[~own["changed"]], own[own["changed"]]
            false = exact_share(float(null["said"].sum()), len(null))
            found = exact_share(float(changed["found"].sum()), len(changed))
            texts = [
                f"{100 * s.value:.3g} % ({100 * s.low:.2g} … {100 * s.high:.3g})"
                for s in (false, found)
            ]
            asked = robot == "all"
            rows.append(
                {
                    "robot": robot,
                    "motion": motion,
                    "pairs": len(null),
                    "said to have changed": Check(
                        texts[0], bool(false.high <= MOST_FALSE), "upper limit at most 10 %"
                    )
                    if asked
                    else texts[0],
                    "friction + 20 % found": Check(
                        texts[1], bool(found.value >= LEAST_FOUND), "at least 90 %"
                    )
                    if asked
                    else texts[1],
                    "and nothing else": f"{100 * (changed['others'] == 0).mean():.3g} %",
                    "stated rise": f"{100 * changed['share'].mean():.3g} %",
                }
            )
    return pd.DataFrame(rows)


def _load_table(loads: dict[str, int]) -> pd.DataFrame:
    pairs, false, found = loads.values()
    row = {
        "pairs": pairs,
        "a change is said": Check(f"{false}", false <= MOST_FALSE_LOADS, "at most 1"),
        "the load is found": Check(f"{found}", found >= LEAST_LOADS * pairs, "at least 96 %"),
    }
    return pd.DataFrame([row])


def kuka(data: str | None) -> dict[str, str]:
    """Return what is said of runs 1 and 3 of the real arm; nothing without the data."""
    folder = data_folder("kuka_lwr4", data)
    if not folder.is_dir():
        return {}
    robot = kuka_lwr4.load_robot(folder)
    logs = [kuka_lwr4.load_log(folder, robot, run) for run in (1, 3)]
    return {
        "every base parameter": compare(robot, *logs).statement,
        "the ladder's first model": compare(robot, *logs, ladder=kuka_lwr4.LADDER).statement,
    }


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the study; write JSON and HTML."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=60)
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    parser.add_argument("--loads", type=int, default=50, help="pairs of logs with a load")
    parser.add_argument("--seed", type=int, default=0, help="of these pairs")
    parser.add_argument("--data", help="folder of the data sets")
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "compare.json")
    options = parser.parse_args(argv)
    with threadpool_limits(1, "blas"):
        loads = measure_loads(options.loads, options.seed)
        if not options.trials:
            return pd.DataFrame([loads])
        rows = [r for name in options.robot or ROBOTS for r in measure(name, options.trials)]
        real = kuka(options.data)
    frame = pd.DataFrame(rows)
    table = summary(frame)
    told = table.map(lambda x: x.text if isinstance(x, Check) else x)
    null, changed = frame[~frame["changed"]], frame[frame["changed"]]
    statement = (
        f"Of {len(null)} comparisons of a robot that did not change "
        f"{100 * null['said'].mean():.2g} % say that something changed; friction that rose by "
        f"20 % in one joint is found in {100 * changed['found'].mean():.3g} % of {len(changed)}."
    )
    print(statement, told.to_string(), *(f"{k}: {v}" for k, v in real.items()), sep="\n")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    content = {"schema": "identifiability/study/compare/1", "statement": statement}
    content |= {"rows": rows, "summary": told.to_dict("records"), "kuka": real}
    content["loads"] = loads
    print(write_json(options.out, content))
    sections = [
        Section("shares", "Planted", "", (frame_table(table, "By robot and motion"),)),
        Section("loads", f"A load of {LOAD:g} kg", "", (frame_table(_load_table(loads)),)),
        *(
            [Section("kuka", "KUKA, runs 1 and 3", "", (Prose(tuple(real.values())),))]
            if real
            else []
        ),
        Section("method", "Method", "", (Prose(((__doc__ or "").partition("\n\n")[2],)),)),
    ]
    title = "Is a change found, and only a change?"
    print(
        write_page(title, statement, sections, options.out.with_suffix(".html"), overline="Study")
    )
    return frame


if __name__ == "__main__":
    main(sys.argv[1:])
