"""How a base that floats moved, from whatever a log has of it: what an ideal sensor there reads.

An inertial sensor (`base.acc.x` … `base.gyro.z`), or pose and twist (`base.x`, `base.qw` …,
MuJoCo's ``qpos[0:7]`` and ``qvel[0:6]``, odometry) become one record: proper acceleration and
angular velocity along the axes of the base, where up is, which contacts are closed, and what
pushes on the robot as far as it was measured.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import NoReturn

import numpy as np
import scipy

from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array, Renames
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.names import words_for
from identifiability.robot.floating import Base

#: What comes first in the name of a column about the base.
OWNERS = ("base", "imu", "odom", "odometry", "pose", "twist", "trunk", "floating_base", "torso")

#: What is measured of it, by words for it and letters that stand for it before an axis.
_KINDS = {
    word: kind
    for kind in ("acc", "gyro", "pos", "vel", "quat")
    for word in words_for(f"base.{kind}")
} | {"": "pos"}
_NUMBERED = {"0": 0, "1": 1, "2": 2, "3": 3}
_AXES = {"x": 0, "y": 1, "z": 2, "w": 3}

#: Where parts of a record are: proper acceleration, angular velocity, up; contacts follow.
ACC, GYRO, UP, AFTER = slice(0, 3), slice(3, 6), slice(6, 9), 9


def find_base(columns: Sequence[str], base: Base, renames: Renames) -> dict[str, str]:
    """Return which columns of a table are about the base, by kind, axis by axis.

    From ``acc.0`` … to the column; quaternions are ``quat.x`` …, where nothing but their names says
    which of four numbers is which. Flags and wrenches are by the names that the sidecar has.
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
    """Return what a column says of the base, as `find_base` has it; empty if nothing."""
    entry = re.fullmatch(r"(?:.*[./_ ])?(qpos|qvel)[\[(_. ]*(\d+)[\])]*", name)
    if entry and base.at is not None:
        k = int(entry[2]) - base.at[entry[1] == "qvel"]
        names = (*(f"pos.{i}" for i in range(3)), *(f"quat.{a}" for a in "wxyz"))
        if entry[1] == "qvel":
            names = (*(f"vel.{i}" for i in range(3)), *(f"gyro.{i}" for i in range(3)))
        return names[k] if 0 <= k < len(names) else ""
    text = re.sub(r"[\[\]()]", ".", name).strip(". ")
    parts = [p for p in re.split(r"[./ ]+", text) if p]
    owners = {*OWNERS, base.body.lower(), base.title.lower()}
    at = [k for k, p in enumerate(parts) if p.lower() in owners]
    if not at:
        return ""
    rest = "_".join(parts[at[-1] + 1 :]).lower().replace("__", "_")
    word, axis = _cut(rest)
    if word not in _KINDS or axis is None:
        return ""
    kind = _KINDS[word]
    if kind == "quat":
        return f"quat.{axis}" if axis in _AXES else ""
    number = _AXES.get(axis, _NUMBERED.get(axis, 9))
    return f"{kind}.{number}" if number < 3 else ""


def _cut(rest: str) -> tuple[str, str | None]:
    """Return word and axis of ``acc_x``, ``ax``, ``qw`` or ``x``."""
    found = re.fullmatch(r"(.*?)_?([xyzw]|\d)", rest)
    return (found[1], found[2]) if found else (rest, None)


@frozen
class RawBase:
    """Columns about the base as a table has them, on the clock of a log.

    Attributes
    ----------
    t : (N,) [s]
    values : mapping of str to (N,)
        By the keys of `find_base`.
    notes : tuple of str
        How they came onto it, half a sentence each.
    """

    t: Array
    values: Mapping[str, Array]
    notes: tuple[str, ...] = ()

    def get(self, kind: str, axes: Sequence[str] = ("0", "1", "2")) -> Array | None:
        """Return columns of a kind (N, k); None if one is missing."""
        keys = [f"{kind}.{a}" for a in axes]
        if any(k not in self.values for k in keys):
            return None
        return np.stack([self.values[k] for k in keys], 1)


def read_base(base: Base, raw: RawBase, source: str) -> tuple[Array, tuple[str, ...]]:
    """Return the record of a base, (N, 9 + c + 6 w), and how it was read, half a sentence each.

    Proper acceleration [m/s²] and angular velocity [rad/s] of its origin along its own axes, where
    up is, whether each contact is closed, and every measured wrench [N, N·m].

    Raises
    ------
    LogError
        If the log does not say how the base moved, or lacks a column that the sidecar names.
    """
    notes = [*raw.notes]
    acc, gyro = raw.get("acc"), raw.get("gyro")
    turn = _orientation(raw, source)
    if acc is not None and gyro is not None:
        imu = base.imu
        omega = (gyro - imu.gyro_bias) @ imu.rotation
        step = signals.sampling_step(raw.t)
        alpha = signals.differentiate(omega, step) if imu.place.any() else np.zeros_like(omega)
        lever = np.cross(alpha, imu.place) + np.cross(omega, np.cross(omega, imu.place))
        acc = (acc - imu.acc_bias) @ imu.rotation - lever
        _check_gravity(base, raw.t, acc, omega, turn, source)
        notes.append("the base's motion is what its inertial sensor says")
    elif turn is not None and (raw.get("pos") is not None or raw.get("vel") is not None):
        acc, omega = _from_pose(base, raw, turn, notes)
    else:
        _refuse(raw, source)
    up = _level(acc, omega, raw.t) if turn is None else turn.inv().apply(-_unit(base.gravity))
    closed = [_closed(base, k, raw, source) for k in range(len(base.contacts))]
    pushed = [_wrench(columns, raw, source) for columns in (w.columns for w in base.wrenches)]
    return np.column_stack([acc, omega, up, *closed, *pushed]), tuple(notes)


def _unit(x: Array) -> Array:
    size = float(np.linalg.norm(x))
    return x / size if size else np.array([0.0, 0.0, -1.0])


def _refuse(raw: RawBase, source: str) -> NoReturn:
    has = f" (it has {listing(sorted(raw.values))})" if raw.values else ""
    raise LogError(
        f"{source} does not say how the base moved{has}: give what its inertial sensor read, "
        "'base.acc.x' … 'base.gyro.z', or its pose, 'base.x' … 'base.z' and 'base.qw' … 'base.qz'; "
        'if the robot hung on a stand, say base = "fixed" in its sidecar.'
    )


def _orientation(raw: RawBase, source: str) -> scipy.spatial.transform.Rotation | None:
    """Return how the base is turned in the world, where a log says it.

    Raises
    ------
    LogError
        If it is no unit quaternion.
    """
    quat = raw.get("quat", "xyzw")
    if quat is None:
        return None
    size = np.linalg.norm(quat, axis=1)
    worst = int(np.argmax(np.abs(size - 1)))
    # A quaternion whose norm is further from one than this is none.
    if not abs(size[worst] - 1) < 0.01:
        raise LogError(
            f"{source}: the quaternion of the base has norm {size[worst]:.3g} in data row "
            f"{worst + 1}, and an orientation has 1; check its columns, or leave them out where an "
            "inertial sensor says how the base moved."
        )
    return scipy.spatial.transform.Rotation.from_quat(quat)


def _spin(turn: scipy.spatial.transform.Rotation, t: Array) -> Array:
    """Return the angular velocity of an orientation along its own axes, (N, 3)."""
    quat = turn.as_quat()
    flips = np.cumsum(np.concatenate([[0], (quat[1:] * quat[:-1]).sum(1) < 0]))
    quat = quat * np.where(flips % 2, -1.0, 1.0)[:, None]
    rate = signals.differentiate(quat, signals.sampling_step(t))
    x, y, z, w = quat.T
    dx, dy, dz, dw = rate.T
    spin: Array = 2.0 * np.stack(
        [
            w * dx - x * dw - y * dz + z * dy,
            w * dy + x * dz - y * dw - z * dx,
            w * dz - x * dy + y * dx - z * dw,
        ],
        1,
    )
    return spin


def _from_pose(
    base: Base, raw: RawBase, turn: scipy.spatial.transform.Rotation, notes: list[str]
) -> tuple[Array, Array]:
    """Return proper acceleration and angular velocity from pose, and from twist where it is."""
    step = signals.sampling_step(raw.t)
    omega = _spin(turn, raw.t)
    given = raw.get("gyro")
    if given is not None:  # along the axes of the base, or of the world
        omega = _nearer(omega, {"its own": given, "the world's": turn.inv().apply(given)},
                        "angular velocity", notes)  # fmt: skip
    place, given = raw.get("pos"), raw.get("vel")
    if place is None:
        assert given is not None
        velocity = given
    else:
        velocity = signals.differentiate(place, step)
    if given is not None:
        velocity = _nearer(velocity, {"the world's": given, "its own": turn.apply(given)},
                           "velocity", notes)  # fmt: skip
    acc = turn.inv().apply(signals.differentiate(velocity, step) - base.gravity)
    notes.append("the base's motion was differentiated from its pose")
    return acc, omega


def _nearer(known: Array, tried: Mapping[str, Array], what: str, notes: list[str]) -> Array:
    """Return the one of two readings that is nearer to what is known."""
    axes = min(tried, key=lambda k: float(np.mean((tried[k] - known) ** 2)))
    notes.append(f"{what} of the base is along {axes} axes, as its pose tells")
    return tried[axes]


def _level(acc: Array, omega: Array, t: Array) -> Array:
    """Return where up is along the axes of the base, (N, 3), from an inertial sensor."""
    turn, slow = _mean_acceleration(acc, omega, t)
    size = np.linalg.norm(slow, axis=1, keepdims=True)
    up: Array = turn.inv().apply(slow / np.where(size > 0, size, 1.0))
    return up


def _mean_acceleration(
    acc: Array, omega: Array, t: Array
) -> tuple[scipy.spatial.transform.Rotation, Array]:
    """Return how the base turned since the start, and its slow acceleration in axes from then.

    In axes that turn back with the gyroscope gravity stands still, but for its drift, and what
    moves the base to and fro has no mean.
    """
    step = signals.sampling_step(t)
    quat = np.empty((len(t), 4))
    quat[0] = 0.0, 0.0, 0.0, 1.0
    moves = scipy.spatial.transform.Rotation.from_rotvec(
        0.5 * (omega[1:] + omega[:-1]) * step
    ).as_quat()
    for k, (x, y, z, w) in enumerate(moves.tolist()):
        a, b, c, d = quat[k]
        quat[k + 1] = (
            d * x + a * w + b * z - c * y,
            d * y - a * z + b * w + c * x,
            d * z + a * y - b * x + c * w,
            d * w - a * x - b * y - c * z,
        )
    turn = scipy.spatial.transform.Rotation.from_quat(quat)
    # So long a gyroscope is trusted, after which gravity corrects it [s].
    spans = np.polynomial.chebyshev.chebvander(
        np.linspace(-1, 1, len(t)), int(step * len(t) / 10.0)
    )
    slow: Array = spans @ np.linalg.lstsq(spans, turn.apply(acc), rcond=None)[0]
    return turn, slow


def _check_gravity(
    base: Base,
    t: Array,
    acc: Array,
    omega: Array,
    turn: scipy.spatial.transform.Rotation | None,
    source: str,
) -> None:
    """Refuse an inertial sensor that does not feel gravity: whatever does not fall away does.

    Raises
    ------
    LogError
        If it reads another unit, or gravity was taken off.
    """
    fall = float(np.linalg.norm(base.gravity))
    if not fall or t[-1] - t[0] < 2.0:  # so long nothing falls
        return

    slow = _mean_acceleration(acc, omega, t)[1] if turn is None else turn.apply(acc).mean(0)
    found = float(np.median(np.linalg.norm(np.atleast_2d(slow), axis=1)))
    if not 0.5 <= found / fall <= 2.0:
        raise LogError(
            f"{source}: the acceleration of the base averages {found:.2g} and not the {fall:.3g} "
            "m/s² of gravity, which a sensor feels as it does not fall: give what it reads itself, "
            "'base.acc.x' … in m/s² and 'base.gyro.x' … in rad/s."
        )


def _closed(base: Base, k: int, raw: RawBase, source: str) -> Array:
    """Return whether a contact is said to be closed, (N,)."""
    contact = base.contacts[k]
    if contact.flag:
        if contact.flag not in raw.values:
            raise LogError(
                f"{source} lacks the column '{contact.flag}', which says when the contact "
                f"'{contact.name}' is closed{near_match(contact.flag, raw.values)} Give it, or a "
                "schedule in the sidecar."
            )
        return (raw.values[contact.flag] > contact.threshold).astype(float)
    if contact.schedule is not None:
        inside = [(raw.t >= a) & (raw.t <= b) for a, b in contact.schedule]
        return np.any(inside, axis=0).astype(float) if inside else np.zeros(len(raw.t))
    return np.ones(len(raw.t))


def _wrench(columns: Sequence[str], raw: RawBase, source: str) -> Array:
    """Return a measured wrench, (N, 6)."""
    missing = [c for c in columns if c not in raw.values]
    if missing:
        raise LogError(
            f"{source} lacks the column{'s' if len(missing) > 1 else ''} {listing(missing)} of a "
            f"measured wrench{near_match(missing[0], raw.values)} Give it, or take the [[wrench]] "
            "out of the sidecar."
        )
    out = np.zeros((len(raw.t), 6))
    out[:, : len(columns)] = np.stack([raw.values[c] for c in columns], 1)
    return out
