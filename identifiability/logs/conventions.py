"""`Conventions`: facts on the logs of a robot before one is read, from sidecar and options.

The robot gives it to all readers: `read_recordings`, `Log.read`, `Log.from_frame`.
"""

from __future__ import annotations

from collections.abc import Mapping

from identifiability.foundation.names import Renames, Strings
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.description import Coupling, Transmission
from identifiability.robot.floating import Base
from identifiability.robot.servo import Servo
from identifiability.robot.sidecar import MeasuredTorque

from .codes import Code


@frozen
class Conventions:
    """Names and meanings of the columns of a log; without any, a log is read literally.

    Attributes
    ----------
    joints : tuple of str
        Actuated joints in the robot's order; other joints need no columns.
    gear : Transmission or None
        Coupled motors that a log may have instead.
    columns : Renames
        Rules from columns or joints of a log to those of the robot: ``[columns]`` and ``--map``.
    scales : mapping
        Joint or motor to scale and offset of its positions and commands: ``[columns]``.
    time_unit : str
        Unit of its times, ``[time]`` and ``--set time_unit``; empty if not stated.
    torque : MeasuredTorque
        Contents of its torque columns: ``[torque]``.
    degrees : tuple of str
        Joints and motors whose angles and rates are in degrees: ``angles`` and ``--set angles``.
    motion_alone : bool
        Whether to accept a log without torque, because only motion is needed.
    locked : mapping
        Locked joint to its position [rad or m].
    servo : Servo or None
        Servos that compute torque from commands, if logs hold no torque.
    commands : bool
        Whether commands are read in addition to torque.
    base : Base or None
        The floating base; logs contain its motion.
    is_held : bool
        Whether the base is stated as fixed, though logs may contain its motion.
    listed : tuple of str
        All joints in the order of the file; numbers count them if there are as many.
    by_file : (bool, bool)
        Whether numbers of positions, and all other numbers, count the actuated joints in the order
        of the file instead of the order of `joints`.
    codes : mapping of str to Code
        Codes that other logs show, by the kind of column.
    lengths : mapping of str to Coupling
        Lengths of tendons as sums over joints, whose positions a log may have instead.
    """

    joints: Strings = ()
    gear: Transmission | None = None
    columns: Renames = Renames()
    scales: Mapping[str, tuple[float, float]] = {}
    time_unit: str = ""
    torque: MeasuredTorque = MeasuredTorque()
    degrees: Strings = ()
    motion_alone: bool = False
    locked: Mapping[str, float] = {}
    servo: Servo | None = None
    commands: bool = False
    base: Base | None = None
    is_held: bool = False
    listed: Strings = ()
    by_file: tuple[bool, bool] = (False, False)
    codes: Mapping[str, Code] = {}
    lengths: Mapping[str, Coupling] = {}

    @property
    def motors(self) -> Strings:
        """Motors that a log may have instead of joints (coupled transmissions)."""
        return self.gear.motors if self.gear else ()

    @property
    def as_listed(self) -> Strings:
        """The actuated joints in the order of the file."""
        order = [*self.listed, *self.joints]
        return tuple(sorted(self.joints, key=order.index))

    @staticmethod
    def of(robot: Robot) -> Conventions:
        """Return the conventions of a robot's logs, from its sidecar and its loading options."""
        gear = robot.transmission
        motors = gear.motors if gear else ()
        turns = [j for j in robot.motor_joints if not robot.is_prismatic(robot.dof_index(j))]
        # A locked joint may be revolute or prismatic; nearly all are revolute.
        degrees = (*turns, *motors, *robot.locked) if robot.angles == "deg" else ()
        joints = robot.motor_joints or robot.joints[:1]
        lengths = {
            cable.name: cable.along.through(robot.couplings)
            for cable in robot.cables
            if cable.along is not None
        }
        return Conventions(
            joints=joints,  # of a body alone no column is about it
            gear=gear,
            columns=robot.columns,
            scales=robot.scales,
            time_unit=robot.time_unit,
            torque=robot.torque,
            degrees=degrees,
            locked=robot.locked,
            servo=robot.servo,
            base=robot.base,
            is_held=robot.said.base == "fixed",
            listed=robot.listed,
            lengths=lengths,
        )
