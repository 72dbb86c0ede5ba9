"""Robots and logs of the study: one to fit, and one of motion that was not fitted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import kuka_lwr4
import numpy as np
import staubli_tx40
from real_data.study import data_folder

from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.robot import Robot
from identifiability.robot.locate import shipped_robots
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, shipped_trajectory, simulate

#: Effects of the model, beside what the robot file states; the joints of real robots have offsets.
BASIC = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")

#: Samples of simulated logs, and their motions where they are not a and b.
SAMPLES, PAPER = 500, ("601", "595")


@dataclass(frozen=True)
class Case:
    """A robot with a log to fit and one of other motion.

    Attributes
    ----------
    name : str
    robot : Robot
    fitted, unseen : Log
    effects : tuple of str
    """

    name: str
    robot: Robot
    fitted: Log
    unseen: Log
    effects: tuple[str, ...]


def simulated(name: str) -> Case:
    """Return a shipped robot with simulated logs, with the paper's noise."""
    robot = Robot.load(name)
    logs = []
    for k, trajectory in enumerate(PAPER if name == "3-rps" else "ab"):
        motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES)
        rng = np.random.default_rng(k)
        logs.append(simulate(robot, motion, noise=PAPER_NOISE, rng=rng))
    return Case(name, robot, logs[0], logs[1], BASIC)


def real(data: Path | None) -> Iterator[Case]:
    """Yield the real robots whose data are there: of each log only what is open to be read."""
    effects = (*BASIC, "torque_offset")
    folder = data_folder("kuka_lwr4", data)
    if folder.is_dir():
        robot = kuka_lwr4.load_robot(folder)
        first, other = (kuka_lwr4.load_log(folder, robot, run) for run in (1, 3))
        yield Case("KUKA LWR4+", robot, first, other, effects)
    folder = data_folder("staubli_tx40", data)
    if folder.is_dir():
        robot = staubli_tx40.load_robot(folder)
        log = staubli_tx40.load_log(folder, robot)
        third = len(log) // 3  # the last one is held back
        halves = (log.cut(0, third, "first third"), log.cut(third, 2 * third, "second third"))
        yield Case("TX40", robot, *halves, effects)
    folder = data_folder("unisa", data)
    if folder.is_dir():
        robot = Robot.load(folder / "ur10.urdf")
        log = Log.read(folder / "ur10_exciting.db3", Conventions.of(robot))
        half = len(log) // 2
        halves = (log.cut(0, half, "first half"), log.cut(half, len(log), "second half"))
        yield Case("UR10", robot, *halves, effects)


def every_case(data: Path | None, only: tuple[str, ...] = ()) -> Iterator[Case]:
    """Yield all cases, or those that are asked for by name."""
    for name in shipped_robots():
        if name in (
            "cart-arm",
            "free-body",
            "walking-quadruped",
        ):  # they float, and are not simulated
            continue
        if not only or name in only:
            yield simulated(name)
    for case in real(data):
        if not only or case.name in only:
            yield case
