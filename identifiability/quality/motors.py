"""Torque columns of coupled motors with a wrong sign, or with the name of another motor.

Readings exchange and reverse torque of joints. The torque of a coupled motor is a part of the
torque of several joints, so that no reading of joints mends its column.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import rms_of
from identifiability.foundation.names import Array

from .registry import Does, MeasuredLogs, check, without


class Misread(NamedTuple):
    """Torque of coupled motors after a change of one or two columns.

    Attributes
    ----------
    how : str
        Key of its sentence.
    motors : list of int
        Motors whose columns are changed.
    torque : (N, m)
        Torque of all motors, each in its unit.
    """

    how: str
    motors: list[int]
    torque: Array


@check("motor", Does.MISREADS)
def find_misread_motors(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield columns of coupled motors whose change makes the torque far more plausible.

    Their motors then give energy to every joint, because friction takes it. The squared residual is
    halved, or falls by a fifth if a joint gives energy by the columns as they are.
    """
    gear = logs.robot.transmission
    if gear is None or not {*gear.motors} <= {*logs.recordings[0].joints}:
        return
    to_joints = gear.ratio[:, None] * gear.coupling
    driven = _are_driven(logs)
    measured = logs.torque[:, driven] @ np.linalg.pinv(to_joints)
    if len(gear.motors) > len(to_joints.T) or not measured.any(axis=0).all():
        return
    changed = [*_list_changes(measured)]
    squares = _square_residuals(logs, to_joints, [x.torque for x in changed])
    speed = logs.motion.actuated_v[:, driven]
    energy = [np.sum(x.torque @ to_joints * speed, axis=0).min() for x in changed]
    share = 0.8 if energy[0] < 0 else 0.5
    plausible = (np.array(energy) > 0) & (squares < share * squares[0])
    if not plausible.any():
        return
    best = changed[int(np.where(plausible, squares, np.inf).argmin())]
    motors = [gear.motors[k] for k in best.motors]
    yield Finding("motor", what=phrase("motor", best.how, motors=motors))


def _are_driven(logs: MeasuredLogs) -> np.ndarray:
    """Return which joints have a motor, (n,) bool: all but the axes of a floating base."""
    return np.isin(logs.joints, logs.robot.motor_joints)


def _square_residuals(logs: MeasuredLogs, to_joints: Array, torques: Sequence[Array]) -> Array:
    """Return the sum of squared residuals for each torque of all motors, (k,).

    Parameters
    ----------
    logs : MeasuredLogs
    to_joints : (m, n)
        Torque of the joints per torque of each motor.
    torques : sequence of (N, m)
        The first is the measured one, whose root mean square is the unit of each motor.
    """
    unit = rms_of(torques[0], axis=0)
    to_motors = np.linalg.pinv(to_joints) / unit
    regressor = logs.structure.model.regressor(logs.robot, logs.motion)
    columns = np.einsum("tjp,jm->tmp", regressor[:, _are_driven(logs)], to_motors)
    each = np.column_stack([(torque / unit).ravel() for torque in torques])
    left = without(each, columns.reshape(len(each), -1))
    return np.sum(left**2, axis=0)


def _list_changes(torque: Array) -> Iterator[Misread]:
    """Yield the torque of motors (N, m) as it is, with one sign reversed, or two exchanged."""
    yield Misread("literal", [], torque)
    count = torque.shape[1]
    for motor in range(count):
        sign = np.where(np.arange(count) == motor, -1.0, 1.0)
        yield Misread("sign", [motor], torque * sign)
    for pair in combinations(range(count), 2):
        order = np.arange(count)
        order[[*pair]] = pair[::-1]
        yield Misread("exchanged", [*pair], torque[:, order])
