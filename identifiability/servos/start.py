"""The robot and numbers with which the search for rollouts begins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs import Log, signals
from identifiability.robot import Robot
from identifiability.robot.servo import Servo
from identifiability.simulation.rollout import COARSE, STEP, CommandedRobot

from .positions import explicable

#: Natural frequencies of a servo and its load that are tried [rad/s].
FREQUENCIES = np.geomspace(2, 250, 17)


def start_rollouts(robot: Robot, log: Log) -> tuple[CommandedRobot, dict[str, Array]]:
    """Return a robot and joints' numbers from which the search begins.

    The file's numbers are used if all gains are known and the file follows the log as well as a
    command that is merely delayed. Otherwise each joint takes the best of a grid of natural
    frequencies and damping ratios: files without rotors and damping do not follow at all.
    """
    servo = robot.servo
    assert servo is not None
    kp = np.where(np.isnan(servo.kp), 1.0, servo.kp)
    guess = replace(servo, kp=kp, kv=np.nan_to_num(servo.kv))
    machine = CommandedRobot(robot, {}, guess)
    delay = servo.delay or 0.0
    numbers = machine.numbers()
    file_error = machine.roll(log, numbers, delay, COARSE * STEP) - log.q
    rms = np.sqrt(np.mean(file_error**2, 0))
    if not servo.unknown.any() and np.all(rms < explicable([log])):
        return machine, numbers
    tried = [numbers, *_list_numbers(machine, servo, log)]
    # Each at its own step: few of them ask for a short one.
    q = np.array([machine.roll(log, one, delay, COARSE * STEP) for one in tried])
    errors = np.nan_to_num((q - log.q) ** 2, nan=1e6).mean(1)
    best = errors.argmin(0)
    chosen = {
        kind: np.array([one[kind] for one in tried])[best, range(len(best))] for kind in numbers
    }
    return CommandedRobot(robot, {}, replace(guess, kp=chosen["kp"])), chosen


def _list_numbers(machine: CommandedRobot, servo: Servo, log: Log) -> Iterator[Mapping[str, Array]]:
    """Yield joints' numbers of each natural frequency and damping ratio.

    A known gain and a frequency tell an inertia. Where no gain is known, the inertia is the file's.
    """
    unknown = np.isnan(servo.kp)
    kv = machine.servo.kv
    inertia = machine.inertia(log.q.mean(0))
    numbers = machine.numbers()
    bodies = inertia - numbers["Ia"]
    # A rotor that the file lacks is taken to be as large as what the heaviest joint moves.
    stated = np.where(numbers["Ia"] > 0, inertia, inertia.max())
    highest = 1.0 / signals.sampling_step(log.t)
    for frequency in FREQUENCIES[highest > FREQUENCIES]:
        needed = np.maximum(servo.kp / frequency**2, bodies)
        total = np.where(unknown, stated, needed)
        kp = np.where(unknown, stated * frequency**2, servo.kp)
        for ratio in (0.2, 0.5, 1.0, 2.0, 4.0):
            damping = np.maximum(2 * total * frequency * ratio - kv, 0.0)
            yield {**numbers, "Ia": total - bodies, "Fv": damping, "kp": kp}
