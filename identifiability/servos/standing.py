"""What keeps joints away from commands that stand: an offset, or what follows the last motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.simulation.rollout import CommandedRobot

from .positions import encoder_noise, resting_rows

#: Effects, in the order of the parts of a distance.
EFFECTS = ("constant", "follows", "scatters")

#: Fewest rests after motion in each direction that tell an offset from friction.
FEWEST_RESTS = 2


@frozen
class Standing:
    """Distances of commands to the positions of one joint at rest.

    Attributes
    ----------
    apart : (r,) [rad or m]
        Command minus position, without the share of gravity, at each rest.
    direction : (r,)
        Sign of the last change of the command; 0 at the start of a log.
    """

    apart: Array
    direction: Array

    @property
    def is_judged(self) -> bool:
        """Whether the joint rests often enough after motion in both directions."""
        fewest = min(np.sum(self.direction > 0), np.sum(self.direction < 0))
        return bool(fewest >= FEWEST_RESTS)

    def split(self) -> tuple[float, float, float]:
        """Return the constant part, the part that follows the direction, and the rest.

        They are medians [rad or m]; a joint that hit something at one rest does not count.
        """
        forward = np.median(self.apart[self.direction > 0])
        backward = np.median(self.apart[self.direction < 0])
        constant = 0.5 * float(forward + backward)
        follows = 0.5 * float(forward - backward)
        scatter = np.abs(self.apart - constant - follows * self.direction)
        return constant, follows, float(np.median(scatter[self.direction != 0]))


def find_standing(machine: CommandedRobot, logs: Sequence[Log]) -> list[Standing]:
    """Return the rests of each joint in logs of commanded positions, (n,).

    The distance at which gravity holds a joint by the machine is subtracted.
    """
    gain = machine.servo.gain
    per_joint = []
    for joint in range(len(gain)):
        rests = [rest for log in logs if log.q_ref is not None for rest in _list_rests(log, joint)]
        direction = np.array([rest.direction for rest in rests])
        at = np.reshape([rest.q for rest in rests], (len(rests), len(gain)))
        command = np.array([rest.command for rest in rests])
        holds = machine.servo.integral[joint] > 0
        sag = 0.0 if holds else machine.gravity(at)[:, joint] / gain[joint]
        per_joint.append(Standing(command - at[:, joint] - sag, direction))
    return per_joint


class Rest(NamedTuple):
    """A joint at rest under a command that stands.

    Attributes
    ----------
    q : (n,) [rad or m]
        Positions of all joints.
    command : float [rad or m]
    direction : float
        Sign of the last change of the command; 0 at the start of a log.
    """

    q: Array
    command: float
    direction: float


def _list_rests(log: Log, joint: int) -> Iterator[Rest]:
    """Yield the rests of a joint."""
    assert log.q_ref is not None
    command = log.q_ref[:, joint]
    rows = resting_rows(log)
    noise = 3.0 * encoder_noise(log)[joint]
    changes = np.flatnonzero(np.diff(command)) + 1
    for start, stop in pairwise([0, *changes.tolist(), len(command)]):
        last = log.q[max(stop - rows, start) : stop]
        if stop - start <= rows or np.ptp(last[:, joint]) > noise:
            continue
        sign = np.sign(command[start] - command[start - 1]) if start else 0.0
        yield Rest(last.mean(0), float(command[start]), float(sign))


def state_standing(machine: CommandedRobot, logs: Sequence[Log]) -> str:
    """Return the effect that keeps joints away from commands that stand; else nothing."""
    found = find_standing(machine, logs)
    judged = [j for j, rests in enumerate(found) if rests.is_judged]
    if not judged:
        return ""
    parts = np.array([found[j].split() for j in judged])
    sizes = np.sqrt(np.sum(parts**2, axis=0))
    effect = EFFECTS[int(sizes.argmax())]
    order = np.argsort(-np.sum(parts**2, axis=1))
    joints = [machine.robot.joints[judged[k]] for k in order]
    each = [
        f"{joint} {1e3 * constant:.0f} and {1e3 * abs(follows):.0f}"
        for joint, (constant, follows, _) in zip(joints, parts[order], strict=True)
    ]
    return phrase("commands", effect, each=each)
