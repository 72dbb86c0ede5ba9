"""Is a planted load found, and do the intervals of `payload` hold it?

Loads of 0.5 to 5 kg, centres up to 0.1 m away, on the six-axis arm and on the Stewart platform.
Each seed is fitted anew to one log without the load, and weighed on one log of another motion: by
itself and, paired, beside a log of that motion without the load. Noise: encoders that are rounded,
torque with autocorrelated errors. With ``--friction 0.06`` the gears rub in proportion to what they
carry, which no model has: always, or only in the log with the load.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from planted_load import PlantedLoad, unit_loads
from threadpoolctl import threadpool_limits

from identifiability import Robot, analyze, payload
from identifiability.foundation.numbers import exact_share
from identifiability.foundation.output import write_json
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.simulation import Noise, shipped_trajectory
from identifiability.simulation.simulator import Campaign
from identifiability.workflows.payload import Load

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: Body that carries the load, and resolution of the encoders [rad or m].
ROBOTS = {"six-dof-arm": ("link_6", 1e-5), "six-ups": ("platform", 1e-6)}

#: Lightest and heaviest load [kg].
MASSES = (0.5, 5.0)

#: Torque noise as a share of each joint's rms, and its correlation from sample to sample.
SIZE, RHO = 0.02, 0.8

#: Logs that the load is found from.
WAYS = ("one log", "paired")

#: What must hold.
LEAST_COVERED, MOST_BIAS = 0.90, 0.03


def measure(
    name: str, seeds: Sequence[int], replicates: int, friction: float = 0.0, when: str = "always"
) -> list[dict[str, Any]]:
    """Return one row a seed and way: planted and found quantities, and what the interval holds.

    Parameters
    ----------
    name : str
    seeds : sequence of int
    replicates : int
    friction : float
        Friction as a share of what a gear carries.
    when : {"always", "loaded"}
        In which logs it is.
    """
    robot = Robot.load(name)
    body, step = ROBOTS[name]
    campaign = Campaign.of(robot, [shipped_trajectory(robot, k) for k in ("a", "b")])
    unit = unit_loads(campaign, body)
    noise = Noise(additive=SIZE, correlation=RHO, encoder=step)
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([seed, len(name)])
        planted = PlantedLoad.draw(float(np.exp(rng.uniform(*np.log(MASSES)))), rng)
        empty, load = np.zeros_like(campaign.torque), unit @ planted.parameters
        rubs = friction * np.sign(campaign.move.dq)
        own = rubs * np.abs(campaign.rigid.tau) if when == "always" else empty
        base, bare = campaign.logs(own, noise, rng)
        _, loaded = campaign.logs(load + rubs * np.abs(campaign.rigid.tau + load), noise, rng)
        fit = analyze(robot, base, replicates=replicates, seed=seed).fit
        for way in WAYS:
            found = payload(robot, fit, loaded, [bare] if way == "paired" else [])
            rows.append({"robot": name, "seed": seed, "way": way} | compare(found, planted))
            numbers = [f"{rows[-1][key]:.4g}" for key in ("mass", "found", "half")]
            print(name, seed, way, *numbers, rows[-1]["mass held"], flush=True)
    return rows


def compare(found: Load, planted: PlantedLoad) -> dict[str, Any]:
    """Return what was planted and what was found."""
    true = planted.quantities
    inside = [q.low <= t <= q.high for q, t in zip(found.quantities, true, strict=True)]
    return {
        "mass": planted.mass,
        "found": found.mass.value,
        "half": found.mass.half,
        "mass held": inside[0],
        "centre held": float(np.mean(inside[1:4])),
        "moments held": float(np.mean(inside[4:])),
        "told": sum(q.told for q in found.quantities),
        "told and held": sum(i for q, i in zip(found.quantities, inside, strict=True) if q.told),
        "all held": float(np.mean(inside)),
        "doubted": bool(found.caveats),
    }


def summary(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row a robot and way; what is asked is checked."""
    rows = []
    for (robot, way), part in frame.groupby(["robot", "way"], sort=False):
        n = len(part)
        error = part["found"] / part["mass"] - 1
        held = exact_share(float(part["mass held"].sum()), n)
        told = part["told and held"].sum() / max(part["told"].sum(), 1)
        bias, se = float(error.mean()), float(error.std(ddof=1) / np.sqrt(n))
        rows.append(
            {
                "robot": robot,
                "way": way,
                "seeds": n,
                "mass held": Check(
                    f"{100 * held.value:.3g} % ({100 * held.low:.2g} … {100 * held.high:.3g})",
                    bool(held.value >= LEAST_COVERED),
                    "at least 90 %",
                ),
                "all ten held": Check(
                    f"{100 * part['all held'].mean():.3g} %",
                    bool(part["all held"].mean() >= LEAST_COVERED),
                    "at least 90 %",
                ),
                "centre": f"{100 * part['centre held'].mean():.3g} %",
                "moments": f"{100 * part['moments held'].mean():.3g} %",
                "of those told": f"{100 * told:.3g} % of {part['told'].sum() / n:.2g}",
                "bias of the mass": Check(
                    f"{100 * bias:.2g} ± {100 * se:.2g} %",
                    bool(abs(bias) <= MOST_BIAS),
                    "at most 3 %",
                ),
                "rms error": f"{100 * np.sqrt((error**2).mean()):.2g} %",
                "± (median)": f"{100 * (part['half'] / part['mass']).median():.2g} %",
                "doubted": f"{100 * part['doubted'].mean():.2g} %",
            }
        )
    return pd.DataFrame(rows)


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the study; write JSON and HTML."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--friction", type=float, default=0.0, help="share of what a gear carries")
    parser.add_argument("--when", choices=("always", "loaded"), default="always")
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    parser.add_argument("--replicates", type=int, default=100, help="of the base fit's bootstrap")
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "payload.json")
    options = parser.parse_args(argv)
    with threadpool_limits(1, "blas"):
        rows = [
            row
            for name in options.robot or ROBOTS
            for row in measure(
                name,
                range(options.first, options.first + options.seeds),
                options.replicates,
                options.friction,
                options.when,
            )
        ]
    frame = pd.DataFrame(rows)
    table = summary(frame)
    told = table.map(lambda x: x.text if isinstance(x, Check) else x)
    statement = (
        f"Of {len(frame)} weighings the 95 % interval holds the planted mass in "
        f"{100 * frame['mass held'].mean():.3g} % and all ten numbers in "
        f"{100 * frame['all held'].mean():.3g} %; the mass is "
        f"{100 * (frame['found'] / frame['mass'] - 1).mean():+.2g} % off on average."
    )
    print(statement, told.to_string(), sep="\n")
    options.out.parent.mkdir(parents=True, exist_ok=True)
    content = {"schema": "identifiability/study/payload/1", "statement": statement}
    print(write_json(options.out, content | {"rows": rows, "summary": told.to_dict("records")}))
    method = (__doc__ or "").partition("\n\n")[2]
    sections = [
        Section("shares", "Planted loads", "", (frame_table(table, "By robot and logs"),)),
        Section("method", "Method", "", (Prose((method,)),)),
    ]
    title = "Is a planted load found?"
    print(
        write_page(title, statement, sections, options.out.with_suffix(".html"), overline="Study")
    )
    return frame


if __name__ == "__main__":
    main(sys.argv[1:])
