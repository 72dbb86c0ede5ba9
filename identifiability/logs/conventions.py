"""`Conventions`: what is known of logs of a robot before one is read, from sidecar and options.

It goes from the robot to whoever reads: `read_recordings`, `Log.read`, `Log.from_frame`.
"""

from __future__ import annotations

from collections.abc import Mapping

from identifiability.foundation.names import Renames, Strings
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.floating import Base
from identifiability.robot.servo import Servo
from identifiability.robot.sidecar import MeasuredTorque

from .codes import Code


@frozen
class Conventions:
    """What columns of a log are called and mean. Without any a log is read as it is.

    Attributes
    ----------
    joints : tuple of str
        Actuated joints in the robot's order; of no others anything is needed.
    motors : tuple of str
        Motors that a log may have instead (coupled transmissions).
    columns : Renames
        From columns, or joints, of a log to those of the robot: ``[columns]`` and ``--map``.
    scales : mapping
        Joint or motor to scale and offset of its positions and commands: ``[columns]``.
    time_unit : str
        Unit of its times, ``[time]`` and ``--set time_unit``; empty if nobody said.
    torque : MeasuredTorque
        What its torque columns hold: ``[torque]``.
    degrees : tuple of str
        Joints and motors whose angles and rates are in degrees: ``angles`` and ``--set angles``.
    motion_alone : bool
        Take a log without any torque: motion is all that is needed of it.
    locked : mapping
        Joint that does not move to where it is held [rad or m].
    servo : Servo or None
        What makes torque of commands, where logs hold no torque.
    commands : bool
        Whether commands are read beside torque, too.
    base : Base or None
        What floats, of whose motion logs have columns.
    passive : tuple of str
        Joints that no motor drives, of which logs need no columns.
    codes : mapping of str to Code
        Codes that other logs show, by the kind of column.
    """

    joints: Strings = ()
    motors: Strings = ()
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
    passive: Strings = ()
    codes: Mapping[str, Code] = {}

    @staticmethod
    def of(robot: Robot) -> Conventions:
        """Return what a robot's sidecar, and what was said when it was loaded, tell of its logs."""
        gear = robot.transmission
        motors = gear.motors if gear else ()
        turns = [j for j in robot.motor_joints if not robot.is_prismatic(robot.dof_index(j))]
        # Of a locked joint nothing says whether it turns, as nearly all do.
        degrees = (*turns, *motors, *robot.locked) if robot.angles == "deg" else ()
        return Conventions(
            joints=robot.motor_joints or robot.joints[:1],  # of a body alone no column is about it
            motors=motors,
            columns=robot.columns,
            scales=robot.scales,
            time_unit=robot.time_unit,
            torque=robot.torque,
            degrees=degrees,
            locked=robot.locked,
            servo=robot.servo,
            base=robot.base,
            passive=tuple(j for j in robot.home_table if j not in robot.motor_joints),
        )
