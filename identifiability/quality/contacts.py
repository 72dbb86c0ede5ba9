"""Contacts of a robot that floats: do those said to be closed stand, does it stay up by them?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.quality.registry import Does, MeasuredLogs, check
from identifiability.quality.rules import RULES
from identifiability.robot.floating import (
    SIX,
    flatness,
    slip_shares,
    standing_contacts,
    turn_by_contacts,
)

#: Fewest samples by which a base is compared with its contacts, and rounds of an alignment.
FEWEST = 32


def _standing(logs: MeasuredLogs) -> Iterator[tuple[Array, Array, Array, np.ndarray]]:
    """Yield positions and velocities of some samples, where up is, and which contacts stand."""
    base = logs.robot.base
    for s in logs.samples:
        if s.motion.touch is not None and base is not None:
            # Samples at which it is looked at whether a closed contact stands.
            motion, few = s.motion, slice(None, None, max(1, len(s.motion) // 5000))
            up, closed = s.motion.touch[:, :3], s.motion.touch[:, 3:] > 0.5
            stands = standing_contacts(base.contacts, motion.t, closed)
            yield motion.q[few], motion.v[few], up[few], stands[few]


@check("slips", Does.HINTS, always=True)
def find_slips(logs: MeasuredLogs) -> list[Finding]:
    """Return which contacts move while they are said to be closed."""
    robot = logs.robot
    if robot.base is None:
        return []
    shares = np.zeros(len(robot.base.contacts))
    for motion in _standing(logs):
        shares = np.fmax(shares, slip_shares(robot.tree, robot.base, *motion))
    named = zip(robot.base.contacts, shares, strict=True)
    moving = [c.name for c, x in named if x > RULES.contact_slips]
    return [Finding("slips", contacts=moving, share=100 * shares.max())] if moving else []


@check("turned", Does.MISREADS)
def find_turned_base(logs: MeasuredLogs) -> list[Finding]:
    """Return how the sensor of a base is turned or scaled against what closed contacts tell."""
    robot, pairs = logs.robot, [(EMPTY, EMPTY)]
    if robot.base is None:
        return []
    for q, v, up, stands in _standing(logs):
        own = turn_by_contacts(robot.tree, robot.base, q, v, up, stands)
        known = np.isfinite(own).all(1)
        pairs.append((_centred(v[known, 3:SIX]), _centred(own[known])))
    told, own = (np.concatenate(x) for x in zip(*pairs, strict=True))
    if len(own) < FEWEST:
        return []
    turn, scale, before, after = _aligned(told, own)
    if before < RULES.contact_slips or after > before / 2:
        return []
    if not 0.5 < scale < 2.0:
        degrees = np.degrees(1.0) / 2 < scale < 2 * np.degrees(1.0)
        unit = phrase("turned", "degrees" if degrees else "other")
        return [Finding("turned", why=phrase("turned", "scale", scale=scale, unit=unit))]
    rpy = pin.rpy.matrixToRpy((robot.base.imu.rotation @ turn).T)
    angle = np.degrees(np.linalg.norm(pin.log3(turn)))
    numbers = ", ".join(f"{x:.3f}" for x in rpy + 0.0)
    return [Finding("turned", why=phrase("turned", "angle", angle=angle, rpy=numbers))]


EMPTY = np.empty((0, 3))


def _centred(x: Array) -> Array:
    """Return turns without the bias of a gyroscope."""
    return x - np.median(x, 0) if len(x) else x


def _aligned(told: Array, own: Array) -> tuple[Array, float, float, float]:
    """Return rotation R and scale s with ``told ≈ s R own`` (N, 3), and errors before and after.

    Of the faster half, as shares (medians) of how fast it turns; the half of the samples that fits
    best tells, as feet move around the times at which they touch [Umeyama, eq. 40].
    """
    fast = np.linalg.norm(told, axis=1)
    told, own = (x[fast >= np.median(fast)] for x in (told, own))
    R, s, used = np.eye(3), 1.0, np.ones(len(told), bool)
    for _ in range(FEWEST):
        U, size, Vt = np.linalg.svd(told[used].T @ own[used])
        sign = np.append([1.0, 1.0], np.sign(np.linalg.det(U @ Vt)))
        R, s = (U * sign) @ Vt, float(size @ sign / max((own[used] ** 2).sum(), 1e-300))
        error = np.linalg.norm(told - s * own @ R.T, axis=1)
        used = error <= np.median(error)
    speed = float(np.median(np.linalg.norm(told, axis=1))) or 1.0
    before = float(np.median(np.linalg.norm(told - own, axis=1)))
    return R, s, before / speed, float(np.median(error)) / speed


@check("soles", Does.MISREADS)
def find_soles(logs: MeasuredLogs) -> list[Finding]:
    """Return which contacts at points stay flat, as soles do."""
    robot = logs.robot
    contacts = () if robot.base is None else robot.base.contacts
    joints = [c.point.joint for c in contacts]  # corners of a sole share one
    alone = [c.kind == "point" and joints.count(c.point.joint) == 1 for c in contacts]
    turns = np.full(len(contacts), np.nan)
    for q, v, _, stands in _standing(logs):
        for k in np.flatnonzero(np.array(alone) & stands.any(0)):
            turns[k] = np.fmax(turns[k], flatness(robot.tree, q, v, contacts[k], stands[:, k]))
    flat = [c.name for c, x in zip(contacts, turns, strict=True) if x < RULES.contact_slips]
    return [Finding("soles", contacts=flat)] if flat else []


@check("unheld", Does.MISREADS)
def find_unheld(logs: MeasuredLogs) -> list[Finding]:
    """Return what measured forces carry where no contact is closed; nothing if it is the robot."""
    robot, some = logs.robot, logs.motion
    fall = 0.0 if robot.base is None else float(np.linalg.norm(robot.base.gravity))
    if robot.base is None or not (fall and logs.weighs):
        return []
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    open_ = ~(closed > 0.5).any(1)
    held = open_ & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(FEWEST, open_.sum() / 2):
        return []
    needed = logs.predicted[held, :3]
    share = float((logs.torque[held, :3] * needed).sum() / (needed**2).sum())
    if share > 0.5:
        return []
    which = "wrenches" if robot.base.wrenches else "closed" if robot.base.contacts else "nothing"
    cause = phrase("unheld", "opposite" if share < -0.5 else "less")
    told = {"name": robot.name, "share": 100 * held.mean(), "held": 100 * share, "cause": cause}
    return [Finding("unheld", why=phrase("unheld", which, **told))]
