"""Closed chains: from the motion of the actuated joints to that of all, and to the regressor."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from identifiability.foundation.engines.local import Processes
from identifiability.regression.regression import Model
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.robot.closure import newton
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from inside.pair import Array, Pair, difference, timed

#: Samples a process is given at a time.
PIECE = 12_500

#: Samples whose regressor is made at a time.
CHUNK = 1024


def measure(samples: int, repeats: int) -> Pair:
    """Close the loops of the 3-RPS, all samples at once and one after the other."""
    robot, move = _motion(samples)
    motion = complete_motion(robot, move.t, move.q, move.dq, move.ddq)
    ours, motion = timed(lambda: complete_motion(robot, move.t, move.q, move.dq, move.ddq), repeats)
    slow, q = timed(lambda: _one_by_one(robot, move.q, motion.q[:1]))
    return Pair(
        "closing loops", "Newton steps for one sample at a time, from the sample before",
        f"{samples} samples, 6 loop equations; ours with velocities and accelerations",
        ours, slow, difference(q, motion.q), 1e-9, "configurations",
    )  # fmt: skip


def _motion(samples: int) -> tuple[Robot, PrescribedMotion]:
    robot = Robot.load("3-rps")
    return robot, PrescribedMotion.of(shipped_trajectory(robot, "601"), samples)


def _one_by_one(robot: Robot, actuated: Array, first: Array) -> Array:
    full, out = first, []
    for row in actuated:
        guess = full.copy()
        for joint in robot.tree.joints:
            at = np.flatnonzero(robot.actuated == joint.iv)
            if len(at):
                guess[:, joint.iq] = row[at[0]]
        full = newton(robot, guess).q
        out.append(full[0])
    return np.array(out)


@dataclass(frozen=True)
class Pace:
    """Time a sample from actuated motion to the projected regressor [µs].

    Attributes
    ----------
    samples, processes : int
    processor : float
        Of all processes together.
    wall : float
        Depends on what else the machine does.
    """

    samples: int
    processes: int
    processor: float
    wall: float


def pace(samples: int, processes: int) -> Pace:
    """Make the projected regressor of the 3-RPS, pieces of the motion shared by processes."""
    pieces = [(at, min(at + PIECE, samples)) for at in range(0, samples, PIECE)]
    with Processes(processes) as engine:
        work = partial(_regress, samples)
        list(engine.map(work, pieces[:1] * processes))  # processes start and import before
        begin = time.perf_counter()
        spent = list(engine.map(work, pieces))
        wall = time.perf_counter() - begin
    return Pace(samples, processes, 1e6 * sum(spent) / samples, 1e6 * wall / samples)


def _regress(samples: int, piece: tuple[int, int]) -> float:
    """Return the processor time of one piece [s]."""
    robot, move = _motion(samples)
    model, rows = Model.of("rigid_body"), slice(*piece)
    begin = time.process_time()
    motion: Motion = complete_motion(
        robot, move.t[rows], move.q[rows], move.dq[rows], move.ddq[rows]
    )
    buffer = np.empty((CHUNK, len(robot.joints), len(model.parameters(robot))))
    for at in range(0, len(motion), CHUNK):
        model.regressor(robot, motion[at : at + CHUNK], out=buffer)
    return time.process_time() - begin
