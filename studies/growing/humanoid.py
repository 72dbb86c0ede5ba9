"""A humanoid on a stand, of as many joints as are asked for: legs first, then trunk, arms, head.

Its numbers are ours: limbs are rods of about a person's sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.robot import Robot
from identifiability.simulation import Noise, random_trajectory, simulate

#: Additive torque noise as a share of each joint's torque, its memory, and an encoder's step [rad].
NOISE = Noise(additive=0.02, correlation=0.5, encoder=1e-5)

#: Samples a second, and harmonics of the motion.
RATE, HARMONICS = 100.0, 8

#: Radius of a limb as a share of its length, for its inertia.
THICKNESS = 0.25


@dataclass(frozen=True)
class Limb:
    """A chain of joints.

    Attributes
    ----------
    name : str
    on : str
        The body it hangs on.
    joints : tuple of (axis, length [m], mass [kg])
        Of each joint and the link that it moves.
    start : tuple of float [m]
        Where it hangs.
    """

    name: str
    on: str
    joints: tuple[tuple[str, float, float], ...]
    start: tuple[float, float, float]


_LEG = (
    ("z", 0.05, 1.5), ("x", 0.05, 1.5), ("y", 0.4, 7.0),
    ("y", 0.4, 3.5), ("y", 0.05, 0.5), ("x", 0.08, 1.0),
)  # fmt: skip
_ARM = (
    ("y", 0.06, 1.0), ("x", 0.06, 1.0), ("z", 0.25, 2.0), ("y", 0.12, 1.0),
    ("z", 0.12, 0.8), ("y", 0.05, 0.3), ("x", 0.1, 0.5),
)  # fmt: skip
LIMBS = (
    Limb("left_leg", "pelvis", _LEG, (0.0, 0.1, -0.1)),
    Limb("right_leg", "pelvis", _LEG, (0.0, -0.1, -0.1)),
    Limb("trunk", "pelvis", (("z", 0.1, 3.0), ("x", 0.1, 3.0), ("y", 0.3, 18.0)), (0, 0, 0.1)),
    Limb("left_arm", "trunk_3", _ARM, (0.0, 0.2, 0.25)),
    Limb("neck", "trunk_3", (("z", 0.05, 0.5), ("y", 0.15, 3.0)), (0.0, 0.0, 0.3)),
    Limb("right_arm", "trunk_3", _ARM, (0.0, -0.2, 0.25)),
    Limb("left_hand", "left_arm_7", (("x", 0.08, 0.2),), (0.0, 0.03, -0.05)),
    Limb("right_hand", "right_arm_7", (("x", 0.08, 0.2),), (0.0, 0.03, -0.05)),
    Limb("left_toe", "left_leg_6", (("y", 0.06, 0.2),), (0.1, 0.0, -0.04)),
    Limb("right_toe", "right_leg_6", (("y", 0.06, 0.2),), (0.1, 0.0, -0.04)),
    Limb("jaw", "neck_2", (("y", 0.05, 0.2),), (0.05, 0.0, 0.02)),
)

#: All joints of the whole.
MOST = sum(len(limb.joints) for limb in LIMBS)


def write_robot(path: Path, joints: int) -> None:
    """Write an MJCF of the first so many joints."""
    if not 1 <= joints <= MOST:
        raise ValueError(f"the humanoid has 1 to {MOST} joints, not {joints}")
    opened, left = list[tuple[str, str, str]](), joints
    for limb in LIMBS:
        on, at = limb.on, limb.start
        down = not limb.name.startswith(("trunk", "neck"))
        for k, (axis, length, mass) in enumerate(limb.joints[:left], start=1):
            name = f"{limb.name}_{k}"
            body = _body(name, at, axis, -length if down else length, mass)
            opened.append((on, name, body))
            on, at = name, (0.0, 0.0, -length if down else length)
            left -= 1
    tree = _nest("pelvis", opened)
    motors = "".join(f'<motor joint="{name}_j"/>\n' for _, name, _ in opened)
    path.write_text(
        f'<mujoco model="humanoid-{joints}">\n<compiler angle="radian"/>\n<worldbody>\n'
        f'<body name="pelvis" pos="0 0 1">\n<inertial pos="0 0 0" mass="8" '
        f'diaginertia=".06 .05 .06"/>\n{tree}</body>\n</worldbody>\n'
        f"<actuator>\n{motors}</actuator>\n</mujoco>\n",
        encoding="utf-8",
    )


def write_log(path: Path, robot: Robot, samples: int, seed: int) -> None:
    """Write positions and torque of a random motion, as CSV or Parquet."""
    rng = np.random.default_rng(seed)
    move = random_trajectory(
        robot, rng, period=samples / RATE, samples=samples, harmonics=HARMONICS
    )
    frame = simulate(robot, move, noise=NOISE, rng=rng).to_frame()
    kept: pd.DataFrame = frame[[c for c in frame.columns if not c.endswith(("dq", "ddq"))]]
    if path.suffix == ".parquet":
        kept.to_parquet(path)
    else:
        kept.to_csv(path, index=False)


def _nest(on: str, bodies: list[tuple[str, str, str]]) -> str:
    """Return the bodies that hang on one, with all that hang on them."""
    return "".join(
        f"{text}{_nest(name, bodies)}</body>\n" for under, name, text in bodies if under == on
    )


def _body(name: str, at: tuple[float, ...], axis: str, length: float, mass: float) -> str:
    """Return a rod that hangs down from its joint or stands on it, without its end tag."""
    along, across = abs(length), THICKNESS * abs(length)
    thin, thick = mass * across**2 / 2, mass * (3 * across**2 + along**2) / 12
    which = " ".join("1" if a == axis else "0" for a in "xyz")
    return (
        f'<body name="{name}" pos="{" ".join(f"{x:g}" for x in at)}">\n'
        f'<joint name="{name}_j" axis="{which}" range="-1 1" damping="{0.3 + 0.1 * mass:.3g}" '
        f'frictionloss="{0.5 + 0.2 * mass:.3g}" armature="{0.01 * mass:.3g}"/>\n'
        f'<inertial pos="{across / 4:.5f} {across / 8:.5f} {length / 2:.5f}" mass="{mass:g}" '
        f'diaginertia="{thick:.6g} {1.1 * thick:.6g} {thin:.6g}"/>\n'
    )
