"""Are intervals of gains what they say? A known load on arms drawn at random, coloured noise.

    python studies/gains.py [--robots 60] [--seed 0]

Arms of two hinges on a turntable, simulated by MuJoCo with and without a load of 1-5 kg, two
motions each, torque columns in units of drives. Printed of each cell: how many intervals hold the
true gain, how many gains are called identifiable, and of these how many are more than 20 % off.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

from identifiability import Robot, identify_gains, simulate
from identifiability.simulation import Noise
from identifiability.simulation.motion import find_motion

ARM = """
<mujoco><compiler angle="radian"/><worldbody><body name="base">
 <body name="table"><joint name="turn" axis="0 0 1" range="-3 3" damping="{0}" frictionloss="{1}"/>
  <inertial pos="0 0 0.1" mass="8" diaginertia="0.1 0.1 0.1"/>
 <body name="upper" pos="0 0 0.3"><joint name="lift" axis="0 1 0" range="-1.5 1.5" damping="{2}"
  frictionloss="{3}" armature="{4}"/><inertial pos="0.2 0 0" mass="{5}" diaginertia=".02 .1 .1"/>
 <body name="fore" pos="0.5 0 0"><joint name="bend" axis="0 1 0" range="-2 2" damping="{6}"
  frictionloss="{7}" armature="0.1"/><inertial pos="0.15 0 0" mass="2" diaginertia=".01 .03 .03"/>
 {8}
 </body></body></body></body></worldbody>
<actuator><motor joint="turn"/><motor joint="lift"/><motor joint="bend"/></actuator></mujoco>
"""
LOAD = '<body name="load"><inertial pos="{}" mass="{}" diaginertia="{} {} {}"/></body>'
GAINS = {"turn": 12.0, "lift": -8.5, "bend": 0.004}
#: Correlation of the noise, its share of the torque's rms, samples of a log (at 100 Hz).
CELLS = [(0.0, 0.1, 1000), (0.9, 0.05, 1000), (0.9, 0.2, 1000), (0.9, 0.4, 1000), (0.98, 0.1, 1000),
         (0.9, 0.2, 300), (0.9, 0.2, 3000)]  # fmt: skip


def draw_arm(folder: Path, rng: np.random.Generator) -> tuple[Robot, Robot, dict]:
    """Return an arm without and with a load, and what is known of that."""
    scale = rng.lognormal(0.0, 0.4, 8)
    numbers = np.array([2, 1, 3, 2, 0.4, 5, 1, 1]) * scale
    mass = rng.uniform(1, 5)
    centre = (rng.uniform(0.1, 0.4), *rng.uniform(-0.05, 0.05, 2))
    size = mass * 0.1**2 * rng.uniform(0.3, 0.5, 3)
    robots = []
    load = LOAD.format(" ".join(map(str, centre)), mass, *size)
    for k, text in enumerate(("", load)):
        path = folder / f"arm{k}.xml"
        path.write_text(ARM.format(*numbers, text))
        robots.append(Robot.load(path))
    return *robots, {"mass": mass, "centre": centre, "inertia": tuple(size)}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cells", default="")
    options = parser.parse_args()
    print("correlation  noise  samples   inside   called   off > 20 %  of")
    for c, (correlation, level, samples) in enumerate(CELLS):
        if options.cells and str(c) not in options.cells.split(","):
            continue
        found = []
        for k in range(options.robots):
            rng = np.random.default_rng([options.seed, c, k])
            with tempfile.TemporaryDirectory() as folder:
                empty, loaded, what = draw_arm(Path(folder), rng)
                noise = Noise(additive=level, correlation=correlation)
                tables = []
                for robot in (empty, loaded):
                    motion = find_motion(robot, "random", samples, rng)
                    tables.append(simulate(robot, motion, noise=noise, rng=rng).to_frame())
                for frame in tables:
                    for joint, gain in GAINS.items():
                        frame[f"{joint}.current"] = frame.pop(f"{joint}.tau") / gain
                for g in identify_gains(empty, *tables, **what).gains:
                    true = GAINS[g.joint]
                    inside = g.interval[0] <= true <= g.interval[1]
                    called = g.verdict == "identifiable"
                    found.append((inside, called, called and abs(g.value / true - 1) > 0.2,
                                  np.isfinite(g.interval[0])))  # fmt: skip
        inside, called, off, told = np.array(found, float).T
        share = inside[told > 0]
        error = np.sqrt(share.mean() * (1 - share.mean()) / max(len(share), 1))
        counts = f"{called.mean():.2f}   {int(off.sum()):6d} {int(called.sum()):6d}"
        sure = f"{share.mean():.3f} ± {error:.3f}"
        print(f"{correlation:11.2f} {level:6.2f} {samples:8d}   {sure}  {counts}", flush=True)


if __name__ == "__main__":
    main()
