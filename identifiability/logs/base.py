"""Reconstruct the motion of a floating base: the readings of an ideal inertial sensor there.

The source is an inertial sensor (`base.acc.x` … `base.gyro.z`) or a pose (`base.x`, `base.qw` …,
odometry), which is differentiated. The result is one record: proper acceleration and angular
velocity along the axes of the base, the upward direction, closed contacts, and measured external
forces.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import TypeAlias

import numpy as np
import scipy

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array, Renames
from identifiability.robot.floating import Base, Contact

from . import signals
from .names import words_for

#: Prefixes of the names of columns about the base.
OWNERS = ("base", "imu", "odom", "odometry", "pose", "trunk", "floating_base", "torso")

#: Quantities of the base, by their words and by the letters before an axis.
_KINDS = {
    word: kind for kind in ("acc", "gyro", "pos", "quat") for word in words_for(f"base.{kind}")
} | {"": "pos"}

#: A base that is stated as fixed.
HELD = Base("", "", np.zeros(3))

#: Where parts of a record are: proper acceleration, angular velocity, up; contacts follow.
ACC, GYRO, UP, AFTER = slice(0, 3), slice(3, 6), slice(6, 9), 9

#: Columns about the base on the clock of a log, (N,) each, by the keys of `find_base`.
Values: TypeAlias = Mapping[str, Array]


def find_base(columns: Sequence[str], base: Base, renames: Renames) -> dict[str, str]:
    """Return which columns of a table are about the base, by kind, axis by axis.

    From ``acc.x`` … to the column. Flags and wrenches are by the names that the sidecar has.
    """
    named: dict[str, str] = {}
    wanted = [c.flag for c in base.contacts if c.flag]
    wanted += [column for w in base.wrenches for column in w.columns]
    for column in columns:
        name = renames.apply(column.strip())
        own = [n for n in (name, column.strip()) if n in wanted]
        key = own[0] if own else _key(name, base)
        if key:
            named.setdefault(key, column)
    return named


def _key(name: str, base: Base) -> str:
    """Return the quantity of a base column, as `find_base` names it; empty if there is none."""
    parts = [p for p in re.split(r"[\[\]()./ ]+", name) if p]
    owners = {*OWNERS, base.body.lower(), base.title.lower()}
    at = [k for k, p in enumerate(parts) if p.lower() in owners]
    quantity = "_".join(parts[at[-1] + 1 :]) if at else ""
    found = re.fullmatch(r"(.*?)_*([xyzw0-2])", quantity.lower())
    if found is None or found[1] not in _KINDS:
        return ""
    kind = _KINDS[found[1]]
    axis = found[2]
    if kind == "quat":  # only names identify the four numbers
        return "" if axis.isdecimal() else f"quat.{axis}"
    axis = "xyz"[int(axis)] if axis.isdecimal() else axis
    return "" if axis == "w" else f"{kind}.{axis}"


def _stack(values: Values, keys: Sequence[str]) -> Array | None:
    """Return columns (N, k); None if one is missing."""
    if values.keys() >= {*keys}:
        return np.stack([values[k] for k in keys], 1)
    return None


def read_base(base: Base, t: Array, values: Values, source: str) -> tuple[Array, str]:
    """Return the record of a base, (N, 9 + c + 6 w), and how it was read, half a sentence.

    The columns are the proper acceleration [m/s²] of its origin and its angular velocity [rad/s],
    both along its axes. The upward direction, the state of each contact and every measured wrench
    [N, N·m] follow.

    Parameters
    ----------
    base : Base
    t : (N,) [s]
    values : mapping of str to (N,)
    source : str
        Name of the log in messages.

    Raises
    ------
    LogError
        If the log lacks the motion of the base, or a column that the sidecar names.
    """
    acc, gyro, place = (
        _stack(values, [f"{kind}.{a}" for a in "xyz"]) for kind in ("acc", "gyro", "pos")
    )
    turn = _orientation(values, source)
    step = signals.sampling_step(t)
    if acc is not None and gyro is not None:
        imu = base.imu
        omega = (gyro - imu.gyro_bias) @ imu.rotation
        alpha = signals.differentiate(omega, step) if imu.place.any() else np.zeros_like(omega)
        lever = np.cross(alpha, imu.place) + np.cross(omega, np.cross(omega, imu.place))
        acc = (acc - imu.acc_bias) @ imu.rotation - lever
        turned, slow = (
            _mean_acceleration(acc, omega, t) if turn is None else (turn, turn.apply(acc).mean(0))
        )
        _check_gravity(base, t, slow, source)
        note = "the base's motion is measured by its inertial sensor"
    elif turn is not None and place is not None:
        omega = _spin(turn, step)
        velocity = signals.differentiate(place, step)
        acc = turn.inv().apply(signals.differentiate(velocity, step) - base.gravity)
        note = "the base's motion was differentiated from its pose"
    else:
        has = f" (it has {listing(sorted(values))})" if values else ""
        raise LogError(
            f"{source} does not say how the base moved{has}: give the readings of its inertial "
            "sensor, 'base.acc.x' … 'base.gyro.z', or its pose, 'base.x' … 'base.z' and "
            "'base.qw' … 'base.qz'; if the robot hung on a stand, say base = \"fixed\" in its "
            "sidecar."
        )
    if turn is None:
        up = turned.inv().apply(slow)
        up /= np.maximum(
            np.linalg.norm(
                up,
                axis=1,
                keepdims=True,
            ),
            TINY,
        )
    else:
        fall = float(np.linalg.norm(base.gravity))
        up = turn.inv().apply(-base.gravity / fall if fall else [0.0, 0.0, 1.0])
    closed = [_closed(c, t, values, source) for c in base.contacts]
    pushed = [_wrench(w.columns, values, source) for w in base.wrenches]
    return np.column_stack([acc, omega, up, *closed, *pushed]), note


def measure_way(values: Values) -> tuple[float, float]:
    """Return how far the pose of a base is from its start at most [m], and its turn [rad].

    They are zero where a log lacks them.
    """
    place = _stack(values, [f"pos.{a}" for a in "xyz"])
    quat = _stack(values, [f"quat.{a}" for a in "xyzw"])
    way = 0.0 if place is None else np.linalg.norm(place - place[0], axis=1).max()
    if quat is None or not np.linalg.norm(quat, axis=1).all():
        return float(way), 0.0
    unit = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    return float(way), float(2.0 * np.arccos(np.abs(unit @ unit[0]).min().clip(0.0, 1.0)))


def _orientation(values: Values, source: str) -> scipy.spatial.transform.Rotation | None:
    """Return the orientation of the base in the world, if a log has it.

    Raises
    ------
    LogError
        If it is not a unit quaternion.
    """
    quat = _stack(values, [f"quat.{a}" for a in "xyzw"])
    if quat is None:
        return None
    size = np.linalg.norm(quat, axis=1)
    worst = int(np.argmax(np.abs(size - 1)))
    # Largest deviation of the norm of a quaternion from one.
    if not abs(size[worst] - 1) < 0.01:
        raise LogError(
            f"{source}: the quaternion of the base has norm {size[worst]:.3g} in data row "
            f"{worst + 1}, and an orientation has 1; check its columns, or leave them out where an "
            "inertial sensor says how the base moved."
        )
    return scipy.spatial.transform.Rotation.from_quat(quat)


def _spin(turn: scipy.spatial.transform.Rotation, step: float) -> Array:
    """Return the angular velocity of an orientation along the axes of the base, (N, 3)."""
    quat = turn.as_quat()
    products = quat[1:] * quat[:-1]
    flips = np.cumsum(np.concatenate([[0], products.sum(1) < 0]))
    quat = quat * np.where(flips % 2, -1.0, 1.0)[:, None]
    rate = signals.differentiate(quat, step)
    v = quat[:, :3]
    w = quat[:, 3:]
    dv = rate[:, :3]
    dw = rate[:, 3:]
    return 2.0 * (w * dv - dw * v - np.cross(v, dv))


def _mean_acceleration(
    acc: Array, omega: Array, t: Array
) -> tuple[scipy.spatial.transform.Rotation, Array]:
    """Return the rotation of the base since the start, and its slow acceleration in axes from then.

    The gyroscope turns the acceleration back into these axes. Gravity is constant there, except for
    the drift of the gyroscope. Oscillations of the base have zero mean.
    """
    step = signals.sampling_step(t)
    rotation = scipy.spatial.transform.Rotation
    mean = 0.5 * (omega[1:] + omega[:-1])
    moves = rotation.from_rotvec(mean * step).as_matrix()
    turns = accumulate(moves, np.matmul, initial=np.eye(3))
    turn = rotation.from_matrix(np.stack([*turns]))
    # After this time gravity corrects the gyroscope [s].
    at = np.linspace(-1, 1, len(t))
    spans = np.polynomial.chebyshev.chebvander(at, int(step * len(t) / 10.0))
    slow = spans @ np.linalg.lstsq(spans, turn.apply(acc), rcond=None)[0]
    return turn, slow


def _check_gravity(base: Base, t: Array, slow: Array, source: str) -> None:
    """Refuse an inertial sensor that does not measure gravity; a base that does not fall must.

    Raises
    ------
    LogError
        If it reads another unit, or gravity was taken off.
    """
    fall = float(np.linalg.norm(base.gravity))
    if not fall or t[-1] - t[0] < 2.0:  # nothing falls for longer
        return
    found = float(np.median(np.linalg.norm(np.atleast_2d(slow), axis=1)))
    if not 0.5 <= found / fall <= 2.0:
        raise LogError(
            f"{source}: the acceleration of the base averages {found:.2g} and not the {fall:.3g} "
            "m/s² of gravity, which a sensor feels as it does not fall: give its raw readings, "
            "'base.acc.x' … in m/s² and 'base.gyro.x' … in rad/s."
        )


def _closed(contact: Contact, t: Array, values: Values, source: str) -> Array:
    """Return the state of a contact by its flag, (N,): closed or open."""
    if not contact.flag:
        return np.ones(len(t))
    if contact.flag not in values:
        raise LogError(
            f"{source} lacks the column '{contact.flag}', which says when the contact "
            f"'{contact.name}' is closed{near_match(contact.flag, values)} Give it."
        )
    return (values[contact.flag] > contact.threshold).astype(float)


def _wrench(columns: Sequence[str], values: Values, source: str) -> Array:
    """Return a measured wrench, (N, 6)."""
    missing = [c for c in columns if c not in values]
    if missing:
        raise LogError(
            f"{source} lacks the column{'s' if len(missing) > 1 else ''} {listing(missing)} of a "
            f"measured wrench{near_match(missing[0], values)} Give it, or take the [[wrench]] "
            "out of the sidecar."
        )
    out = np.zeros((len(values[columns[0]]), 6))
    out[:, : len(columns)] = np.stack([values[c] for c in columns], 1)
    return out
