"""`Reading`: one way to understand the columns of the logs, and the direction of gravity.

Torque columns may be exchanged, reversed, delayed or in another unit. Position columns may be
exchanged, reversed or in degrees. A drive may have taken gravity out of the torque. The base may be
mounted in another direction, and torque offsets may differ between logs. Each of these is the
model of the same base parameters along other rows, or under other gravity. Encoder zeros of a tree
are groups of the mixed model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from identifiability.effects.base import GravityTilt
from identifiability.effects.inertia import Payload
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.foundation.values import Fields, frozen
from identifiability.logs import Log
from identifiability.logs.prepare.preparation import has_motors, joint_log
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion

from .verification import Verification

#: Columns of a log that move with the positions.
MOTION_COLUMNS = ("q", "q_ref", "dq", "ddq", "dq_ref")


@frozen
class Reading:
    """One way to understand the columns of the logs, and the direction of gravity.

    Attributes
    ----------
    description, remedy : str
        How it differs from the literal reading, and what the user can do.
    order : (n,) int
        Column of the log that is the torque of each joint.
    factor : (n,)
        Factor from each torque column to the torque of its joint.
    delay : (n,) [s]
        Time by which each torque column is late.
    late : str
        The log whose columns are; empty if all are.
    compensated : (n,) bool
        Joints whose torque lacks gravity. `read` adds the gravity torque of the fitted robot.
    gravity : (3,) [m/s²]
        Gravity in the world of the robot file.
    turned : bool
        Whether the direction of gravity was fitted.
    carries : bool
        Whether the torque has the weight of a payload, though gravity is zero.
    motion : (n, n)
        Matrix A: the joint positions are A q.
    parameters : (p,)
        Standard parameters of the fitted robot. Empty where no gravity torque is added.
    separate_offsets : bool
        Whether each log has its own torque offsets.
    offsets : mapping of str to (n,) [N·m or N]
        Torque offsets by the name of the log, less their mean.
    load : Finding or None
        A load of one log that explains as much as these offsets. It is reported in their place.
    link_side : (n,) bool
        Joints whose torque sensor sits behind the gear. Empty if none does.
    fitted_numbers : int
        Count of the reading's fitted numbers.
    log_odds : float
        Gain in log evidence of the rows, less ½ ln N for each fitted number [Schwarz 1978].
    error_ratio : float
        Error of the model under this reading over that under the literal reading.
    verification : Verification or None
        Result on rows that did not choose its numbers; None for the literal reading.
    """

    description: str
    remedy: str
    order: Array
    factor: Array
    delay: Array
    compensated: Array
    gravity: Array
    motion: Array
    late: str = ""
    turned: bool = False
    carries: bool = False
    parameters: Array = np.empty(0)
    separate_offsets: bool = False
    offsets: Mapping[str, Array] = {}
    load: Finding | None = None
    link_side: Array = np.zeros(0, bool)
    fitted_numbers: int = 0
    log_odds: float = 0.0
    error_ratio: float = 1.0
    verification: Verification | None = None

    @staticmethod
    def literal(robot: Robot) -> Reading:
        """Return the reading of the columns as they are named."""
        n = len(robot.joints)
        compensated = np.zeros(n, bool)
        return Reading(
            description="",
            remedy="",
            order=np.arange(n),
            factor=np.ones(n),
            delay=np.zeros(n),
            compensated=compensated,
            gravity=robot.gravity,
            motion=np.eye(n),
        )

    @property
    def holds(self) -> bool:
        """Return whether it is used: rows that did not choose its numbers confirm it."""
        return self.load is None and self.verification is not None and self.verification.holds

    @property
    def statement(self) -> str:
        """How it differs from the literal reading, its evidence, and the remedy."""
        if self.verification is not None and not self.holds:
            # A question is put as a possibility.
            claim = self.description.replace(" seems to ", " may ").replace(" seem to ", " may ")
            return f"{claim}. {self.verification.doubt} {self.remedy} if that is so."
        if self.link_side.any():
            return f"{self.description} ({self.log_odds:.3g} nats). {self.remedy}."
        less = percent(1.0 - self.error_ratio, 2)
        evidence = f"with this reading the model errs {less} less ({self.log_odds:.3g} nats)"
        return f"{self.description}: {evidence}. {self.remedy}."

    @property
    def moves_joints(self) -> bool:
        """Return whether the positions differ from the literal ones."""
        n = len(self.order)
        return not np.array_equal(self.motion, np.eye(n))

    @property
    def changes_torque(self) -> Array:
        """Joints whose torque column is read in another way, (n,) bool; offsets do not count."""
        exchanged = self.order != np.arange(len(self.order))
        changed = exchanged | (self.factor != 1.0) | (self.delay != 0.0) | self.compensated
        return np.asarray(changed)

    @property
    def keeps_columns(self) -> bool:
        """Return whether all columns are read literally, so that at most gravity differs."""
        return not (self.changes_torque.any() or self.separate_offsets or self.moves_joints)

    @property
    def rescaled(self) -> Array:
        """Joints whose torque column has another unit, (n,) bool."""
        return np.abs(self.factor) != 1.0

    def structure(self, literal: Structure) -> Structure:
        """Return the model under the reading's gravity; another direction becomes a tilt effect."""
        robot = literal.robot
        if self.link_side.any():
            return Structure.of(self.robot(robot), literal.model)
        if np.allclose(self.gravity, robot.gravity) and not self.turned:
            return literal
        if self.gravity.any():
            return Structure.of(robot, literal.model + GravityTilt(self.gravity))
        model = literal.model + Payload(robot.gravity) if self.carries else literal.model
        return Structure.of(self.robot(robot), model)

    def robot(self, robot: Robot) -> Robot:
        """Return a robot under the reading's gravity and places of torque sensors."""
        turned = robot.model.copy()
        turned.gravity.linear = self.gravity
        torque = robot.torque
        if self.link_side.any():
            joints = np.array(robot.joints)[self.link_side].tolist()
            torque = torque.model_copy(update={"side": dict.fromkeys(joints, "link")})
        return replace(robot, model=turned, torque=torque)

    def read(self, log: Log, literal: Structure) -> Log:
        """Return a log whose columns are corrected; a long log is corrected piece by piece.

        Parameters
        ----------
        log : Log
            With its columns in the robot's order of joints.
        literal : Structure
            The model of the literal reading, in whose columns `parameters` are.
        """
        robot = literal.robot
        if has_motors(robot, log):
            log = joint_log(robot, log)
        named = [joint in log.joints for joint in robot.joints]
        columns = np.flatnonzero(named)
        return log.changed(lambda rows, _: self._read_rows(rows, log, literal, columns))

    def _read_rows(self, rows: Log, log: Log, literal: Structure, columns: Array) -> Log:
        """Return some rows of a log with corrected columns.

        Parameters
        ----------
        rows, log : Log
            Some rows, and all.
        literal : Structure
        columns : (k,) int
            Joints of the robot that have columns in the log: all but the axes of a floating base.
        """
        if self.late not in ("", log.name):
            return replace(self, delay=0.0 * self.delay, late="")._read_rows(
                rows, log, literal, columns
            )
        gravity = self.gravity_torque(rows, literal)
        offset = np.broadcast_to(self.offsets.get(log.name, 0.0), self.factor.shape)[columns]
        torque = self._shifted(rows.t, log, columns, log.tau)
        torque = torque * self.factor[columns] + gravity - offset
        gone = self._unmeasured(rows.t, log, columns)
        return replace(rows, tau=torque, unmeasured=gone, **self._moved(rows))

    def _unmeasured(self, times: Array, log: Log, columns: Array) -> Array | None:
        """Return a mask of torque that was not measured at some times, (N, k); None if all was.

        The last torque of a delayed column comes after the end of the log.
        """
        if log.unmeasured is None and not self.delay.any():
            return None
        at = times[:, None] + self.delay[columns]
        outside = (at < log.t[0]) | (at > log.t[-1])
        if log.unmeasured is not None:
            outside |= self._shifted(times, log, columns, log.unmeasured) > 0.0
        return np.asarray(outside)

    def _shifted(self, times: Array, log: Log, columns: Array, values: Array) -> Array:
        """Return the values (N, k) of torque columns at some times, without their delays."""
        shifted = []
        order = np.searchsorted(columns, self.order[columns])
        for delay, column in zip(self.delay[columns].tolist(), order.tolist(), strict=True):
            first, last = np.searchsorted(log.t, times[[0, -1]] + delay)
            near = slice(max(first - 1, 0), last + 1)
            shifted.append(np.interp(times + delay, log.t[near], values[near, column]))
        return np.column_stack(shifted)

    def gravity_torque(self, log: Log, literal: Structure) -> Array:
        """Return the gravity torque that the compensated columns lack, (N, n)."""
        torque = np.zeros(log.tau.shape)
        if not self.compensated.any():
            return torque
        robot = literal.robot
        still = np.zeros(log.q.shape)
        motion = complete_motion(robot, log.t, log.q, still, still)
        down, up = (
            literal.model.regressor(robot.turned(sign * robot.gravity), motion) @ self.parameters
            for sign in (1, -1)
        )
        # Preparation drops the samples whose loops do not close.
        torque[motion.kept] = 0.5 * self.compensated * (down - up)
        return torque

    def _moved(self, log: Log) -> Fields:
        """Return the corrected motion columns that the log has, (N, n) by name."""
        if not self.moves_joints:
            return {}
        measured = {name: getattr(log, name) for name in MOTION_COLUMNS}
        return {name: x @ self.motion.T for name, x in measured.items() if x is not None}
