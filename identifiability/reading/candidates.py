"""`ReadingCandidates`: the readings that are tried, but for those whose numbers need a search.

The sidecar can state how torque is to be read. Then no other way is tried.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, permutations, product
from typing import Any

import numpy as np

from identifiability.effects.functions import has_session
from identifiability.effects.inertia import WEIGHT
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.quoting import toml_key
from identifiability.foundation.rounding import join
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.preparation import has_motors
from identifiability.logs.spikes import TURN
from identifiability.quality import MeasuredLogs
from identifiability.quality.hints import find_torque_scale, measure_factors
from identifiability.quality.magnitudes import may_be_magnitudes
from identifiability.robot import Robot
from identifiability.robot.description import write_gravity

from .reading import Reading

#: Units of one joint's torque relative to the other joints', and delays [s].
UNITS: tuple[Tolerance, ...] = (1e-3, 1e-2, 0.1, 10.0, 1e2, 1e3)
DELAYS: tuple[Tolerance, ...] = (0.02, 0.05, 0.1, 0.2)
#: Joints up to which exchanged positions and cycles are tried, and legs that are permuted.
MOST, LEGS = 8, 4

CORRECT_COLUMNS = "Correct the log or the map of its columns"
CORRECT_POSITIONS = "Correct the log, the map of its columns or their unit"
CORRECT_ZERO = "Write the tilt into the robot file, or the zero under [columns] in the sidecar"
COMPARE_OFFSETS = "Those of another log cannot be known; compare gives these with their intervals"
CORRECT_GEARS = 'Correct units in the log, or say side = "motor" and each ratio under [torque]'


@frozen
class ReadingCandidates:
    """Candidate readings of some logs.

    Attributes
    ----------
    logs : MeasuredLogs
    literal : Reading
    turns_gravity : bool
        Whether the data distinguish torque without gravity from torque with it.
    measured : tuple of int
        Joints whose torque is measured: all but axes of a floating base.
    """

    logs: MeasuredLogs
    literal: Reading
    turns_gravity: bool
    measured: tuple[int, ...]

    def of_torque(self) -> Iterator[Reading]:
        """Yield the readings of the torque columns."""
        yield from self.compensated()
        yield from self.exchanged()
        yield from self.sign_reversed(self.literal)
        yield from self.rescaled()
        yield from self.geared()
        yield from self.offset()
        yield from self.delayed()

    def of_positions(self) -> Iterator[Reading]:
        """Yield positions that are exchanged, reversed or in degrees; of closed chains only legs.

        Loops are closed anew for each motion, which takes long.
        """
        yield from self.exchanged_positions()
        if self.logs.robot.closed:
            return
        for joint in self.measured:
            yield from self.reversed_positions(joint)
            yield from self.positions_in_degrees(joint)

    @property
    def names(self) -> Strings:
        """The actuated joints, or the motors that move one joint each."""
        named = list_columns(self.logs)
        return tuple(own or joint for own, joint in zip(named, self.logs.joints, strict=True))

    def is_joint(self, joint: int) -> Array:
        """Return a mask of one joint, (n,) bool."""
        return np.arange(len(self.names)) == joint

    def single_joints(self) -> list[tuple[str, Array]]:
        """Return a subject for each joint's torque, and the joint's place, (n,) bool."""
        return [(f"The torque of {self.names[j]}", self.is_joint(j)) for j in self.measured]

    def all_subjects(self) -> list[tuple[str, Array]]:
        """Return subjects for the torque of each joint and of all, and their places."""
        everywhere = np.ones(len(self.names), bool)
        return [*self.single_joints(), ("The torque of all joints", everywhere)]

    def _may_be_magnitude(self, at: Array) -> bool:
        """Return whether a single joint is meant, (n,) bool, whose torque may have lost its sign.

        Magnitudes fit with no sign and no unit, and may fit a little better with wrong ones.
        """
        return bool(at.sum() == 1 and may_be_magnitudes(self.logs)[at].all())

    def compensated(self) -> Iterator[Reading]:
        """Yield torque without gravity: of all joints, then of one."""
        if not self.turns_gravity or self.logs.robot.torque.compensated is not None:
            return
        yield self._other(
            "The effort seems to be compensated for gravity",
            "Say compensated = true under [torque] in the sidecar",
            gravity=np.zeros(3),
        )
        yield self._other(
            "The effort seems to be compensated for gravity of the robot, but not of its payload",
            "Say compensated = true under [torque] in the sidecar",
            gravity=np.zeros(3),
            carries=True,
            fitted_numbers=len(WEIGHT),
        )
        if not self.logs.weighs:
            return
        for j in self.measured:
            name = self.names[j]
            yield self._other(
                f"The effort of {name} seems to be compensated for gravity",
                f'Say compensated = ["{name}"] under [torque] in the sidecar',
                compensated=self.is_joint(j),
            )

    def exchanged(self) -> Iterator[Reading]:
        """Yield torque columns that are exchanged: pairs, cycles of three, and equal legs."""
        for order in self.orders():
            yield self._other(
                f"The torque columns of {self._moved_by(order)} seem to be exchanged",
                CORRECT_COLUMNS,
                order=order,
            )

    def orders(self) -> list[Array]:
        """Return the orders of joints that are tried, (n,) int each."""
        cycles: list[tuple[int, ...]] = [*combinations(self.measured, 2)]
        if len(self.measured) <= MOST:
            for i, j, k in combinations(self.measured, 3):
                cycles += [(i, j, k), (i, k, j)]
        orders = [*(self._cycle(cycle) for cycle in cycles), *self.leg_orders()]
        # A permutation of legs may be a cycle as well.
        return list({order.tobytes(): order for order in orders}.values())

    def leg_orders(self) -> list[Array]:
        """Return the orders of joints that permute equal legs, (n,) int each."""
        legs = list_legs(self.logs.robot)
        if not 2 <= len(legs) <= LEGS:
            return []
        orders = []
        for other in list(permutations(legs))[1:]:
            order = self.literal.order.copy()
            order[np.concatenate(legs)] = np.concatenate(other)
            orders.append(order)
        return orders

    def _moved_by(self, order: Array) -> str:
        """Return the names of the joints that an order moves."""
        return join([self.names[k] for k in np.flatnonzero(order != self.literal.order)])

    def sign_reversed(self, reading: Reading) -> Iterator[Reading]:
        """Yield a reading with one more change of sign: of one joint's torque, then of all."""
        for _, at in self.all_subjects():
            if not self._may_be_magnitude(at):
                yield self.with_signs(np.where(at, -1.0, 1.0) * reading.factor)

    def with_signs(self, factor: Array) -> Reading:
        """Return torque with other signs, (n,) of 1 or -1; a stated sign is contradicted."""
        reversed_joints = [self.names[j] for j in self.measured if factor[j] < 0]
        subject = "all joints" if self._reverses_all(factor) else join(reversed_joints)
        description = f"The torque of {subject} seems to have the wrong sign"
        claims = []
        known = self.logs.robot.torque
        for sign in (1, -1):
            stated = [n for n in reversed_joints if known.at("sign", n) == sign]
            claims += [f"sign = {sign} for {join(stated)}"] if stated else []
        if claims:
            contradicted = f"the sidecar states {join(claims)}, and the logs seem to contradict it"
            description = f"{description} ({contradicted})"
        remedy = f"Correct its sign in the log, or {self._write_signs(factor)}"
        return self._other(description, remedy, factor=factor)

    def _reverses_all(self, factor: Array) -> bool:
        """Return whether the torque of every motor has another sign, of factors (n,)."""
        driven = np.isin(self.logs.joints, self.logs.robot.motor_joints)
        return bool((factor[driven] < 0).all())

    def _write_signs(self, factor: Array) -> str:
        """Return the remedy for the sidecar, with all signs of the torque in one line."""
        negative = []
        for j in self.measured:
            stated = self.logs.robot.torque.at("sign", self.names[j]) or 1
            if stated * factor[j] < 0:
                negative.append(f"{toml_key(self.names[j])} = -1")
        if not negative:
            return "remove sign from [torque] in the sidecar"
        together = f"{{{', '.join(negative)}}}"
        everywhere = self._reverses_all(factor) and len(negative) == len(self.measured)
        value = "-1" if everywhere else together
        return f"say sign = {value} under [torque] in the sidecar"

    def rescaled(self) -> Iterator[Reading]:
        """Yield torque of one joint in another unit than the other joints'."""
        if self.logs.robot.torque.gain or len(self.names) < 2:
            return
        joints = [(s, at) for s, at in self.single_joints() if not self._may_be_magnitude(at)]
        for unit, (subject, at) in product(UNITS, joints):
            yield self._other(
                subject,
                "Correct its unit in the log",
                factor=np.where(at, 1 / unit, 1.0),
                fitted_numbers=1,
            )

    def geared(self) -> Iterator[Reading]:
        """Yield torque of motors, each before its gear, if the file's masses show that."""
        if self.logs.robot.torque.gain or not [*find_torque_scale(self.logs)]:
            return
        factors = measure_factors(self.logs)
        shows = np.isfinite(factors)
        mean = np.exp(np.log(factors[shows]).mean())
        pairs = zip(self.names, factors, strict=True)
        each = ", ".join(f"{name} {x:.2g}" for name, x in pairs if np.isfinite(x))
        yield self._other(
            f"Torque is a multiple of the torque that the robot file predicts: {each}",
            CORRECT_GEARS,
            factor=np.where(shows, mean / factors, 1.0),
            fitted_numbers=len(self.names) - 1,
        )

    def offset(self) -> Iterator[Reading]:
        """Yield torque offsets that differ between logs.

        If the logs share the clock of a session, offsets are a function of its time instead.
        """
        samples = self.logs.samples
        if len(samples) < 2 or has_session([s.motion for s in samples]):
            return
        yield self._other(
            "Torque offsets differ between logs",
            COMPARE_OFFSETS,
            separate_offsets=True,
        )

    def in_log(self, subject: str) -> Reading:
        """Return torque of all joints in one log that is late by 1 s."""
        shift = "Shift the torque columns of this log"
        return self._other(subject, shift, delay=np.ones(len(self.names)), fitted_numbers=1)

    def delayed(self) -> Iterator[Reading]:
        """Yield torque that is late or early: of one joint, then of all."""
        for delay, sign, (subject, at) in product(DELAYS, (-1, 1), self.all_subjects()):
            yield self._other(
                subject,
                "Shift the column in the log",
                delay=np.where(at, sign * delay, 0.0),
                fitted_numbers=1,
            )

    def exchanged_positions(self) -> Iterator[Reading]:
        """Yield joints whose positions are exchanged, without and with their torque."""
        if len(self.measured) > MOST:
            return
        pairs = [self._cycle(pair) for pair in combinations(self.measured, 2)]
        for order in self.leg_orders() if self.logs.robot.closed else pairs:
            pair = self._moved_by(order)
            motion = self.literal.motion[order]
            what = f"The positions of {pair} seem to be exchanged"
            yield self._other(what, CORRECT_POSITIONS, motion=motion)
            what = f"The joints {pair} seem to be exchanged"
            yield self._other(what, CORRECT_POSITIONS, motion=motion, order=order)

    def reversed_positions(self, joint: int) -> Iterator[Reading]:
        """Yield positions of a joint with the other sign, without and with its torque."""
        name = self.names[joint]
        sign = np.where(self.is_joint(joint), -1.0, 1.0)
        motion = self.literal.motion * sign[:, None]
        what = f"The positions of {name} seem to have the wrong sign"
        yield self._other(what, CORRECT_POSITIONS, motion=motion)
        what = f"The joint {name} seems to turn the other way"
        yield self._other(what, CORRECT_POSITIONS, motion=motion, factor=sign)

    def positions_in_degrees(self, joint: int) -> Iterator[Reading]:
        """Yield positions of a revolute joint in degrees.

        Degrees of a joint that moves enough to be identified span more than a turn in radians.
        """
        positions = self.logs.motion.actuated_q[:, joint]
        if self.logs.robot.slides[joint] or np.ptp(positions) <= TURN:
            return
        unit = np.where(self.is_joint(joint), np.pi / 180, 1.0)
        yield self._other(
            f"The angles of {self.names[joint]} seem to be degrees",
            CORRECT_POSITIONS,
            motion=self.literal.motion * unit[:, None],
        )

    def turned(self, gravity: Array) -> Reading:
        """Return the reading under which gravity (3,) [m/s²] acts in another direction."""
        robot = self.logs.robot.turned(gravity)
        return self._other(
            "" if robot.tilt is None else f"Gravity {robot.tilt.text}",
            f"Export it, or state it in the robot file ({write_gravity(robot)})",
            gravity=gravity,
            turned=True,
            fitted_numbers=2,
        )

    def _other(self, description: str, remedy: str, **changes: Any) -> Reading:
        """Return the literal reading with some changes, their description, and the remedy."""
        return replace(self.literal, description=description, remedy=remedy, **changes)

    def _cycle(self, joints: tuple[int, ...]) -> Array:
        """Return the order that gives each of some joints the column of the next, (n,) int."""
        order = self.literal.order.copy()
        order[list(joints)] = np.roll(joints, -1)
        return np.asarray(order)


def list_columns(logs: MeasuredLogs) -> Strings:
    """Return the joint or motor whose column is the torque of each joint alone, (n,).

    It is empty for axes of a floating base, and for joints that a coupled motor moves with others.
    """
    log = logs.recordings[0]
    gear = logs.robot.transmission
    if gear is None or not has_motors(logs.robot, log):
        return tuple(joint if joint in log.joints else "" for joint in logs.joints)
    moves = gear.coupling != 0
    names = dict.fromkeys(logs.joints, "")
    for joint, drives in zip(logs.robot.motor_joints, moves.T, strict=True):
        (motors,) = np.nonzero(drives)
        if moves[motors].sum() == 1:
            names[joint] = gear.motors[motors[0]]
    return tuple(names.values())


def list_legs(robot: Robot) -> list[list[int]]:
    """Return the actuated joints of each branch that begins at the base, if branches are equal."""
    parents = [*robot.model.parents]
    legs = defaultdict[int | str, list[int]](list)
    for place, name in enumerate(robot.joints):
        joint = robot.model.getJointId(name)
        if joint == len(parents):
            # An actuator between two bodies has no joint: it is a leg of its own.
            legs[name].append(place)
            continue
        while parents[joint]:
            joint = parents[joint]
        legs[joint].append(place)
    equal = len({len(leg) for leg in legs.values()}) == 1
    return list(legs.values()) if equal else []
