"""Robots drawn at random, as files: serial arms with joints that turn or slide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from identifiability.robot import Robot


def draw_arm(rng: np.random.Generator, folder: Path, kinds: str) -> Robot:
    """Return an arm with random bodies, axes, friction and rotors.

    Parameters
    ----------
    rng : numpy.random.Generator
    folder : Path
        Where its file is written.
    kinds : str
        Of its joints from the base on: R turns, P slides.
    """
    opened, closed, motors = [], [], []
    for k, kind in enumerate(kinds):
        length, mass = rng.uniform(0.15, 0.4), rng.uniform(1.0, 6.0)
        turn = " ".join(f"{x:.6f}" for x in Rotation.random(random_state=rng).as_quat())
        centre = " ".join(f"{x:.6f}" for x in rng.uniform(-0.12, 0.12, 3))
        a, b, c = mass * rng.uniform(0.05, 0.15, 3) ** 2
        size = 0.05 if kind == "R" else 0.5
        opened.append(
            f'<body name="link{k}" pos="{length:.6f} 0 0" quat="{turn}">'
            f'<inertial pos="{centre}" mass="{mass:.6f}" diaginertia="{b + c} {a + c} {a + b}"/>'
            f'<joint name="j{k}" type="{"hinge" if kind == "R" else "slide"}" axis="0 0 1" '
            f'range="{"-1.5 1.5" if kind == "R" else "-0.25 0.25"}" '
            f'damping="{rng.uniform(0.5, 3):.6f}" frictionloss="{rng.uniform(0.5, 3):.6f}" '
            f'armature="{size * rng.uniform(0.5, 2):.6f}"/>'
        )
        closed.append("</body>")
        motors.append(f'<motor name="m{k}" joint="j{k}"/>')
    path = folder / f"arm{rng.integers(1 << 40)}.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><worldbody>'
        + "".join(opened + closed)
        + "</worldbody><actuator>"
        + "".join(motors)
        + "</actuator></mujoco>"
    )
    return Robot.load(path)
