"""Contacts of a robot that floats: do those said to be closed stand, are impacts aliased?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs.base import ACC
from identifiability.logs.signals import sampling_step
from identifiability.robot.floating import (
    SIX,
    flatness,
    slip_shares,
    standing_contacts,
    turn_by_contacts,
)
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check
from identifiability.workflows.oddities.rules import RULES

#: Where windows are sorted by their power, noise that never rests has in this share of them, the
#: quietest,
QUIET: Tolerance = 0.2


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


@check(
    "closed contacts that move",
    Does.HINTS,
    57,
    always=True,
    says="… against the other closed contacts, at up to … % of how fast they do else",
    means="A foot or support that is said to stand slips, or its flag, schedule or frame is wrong.",
    do="Look at the flags of the contact that is named; slipping stretches are left out by "
    "`schedule`.",
)
def find_slips(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which contacts move while they are said to be closed; nothing if none does."""
    robot = logs.robot
    if robot.base is None:
        return ()
    shares = np.zeros(len(robot.base.contacts))
    for motion in _standing(logs):
        shares = np.fmax(shares, slip_shares(robot.tree, robot.base, *motion))
    moving = [
        c.name for c, x in zip(robot.base.contacts, shares, strict=True) if x > RULES.contact_slips
    ]
    if not moving:
        return ()
    return (
        f"{listing(moving, 4)} {'moves' if len(moving) == 1 else 'move'} against the other closed "
        f"contacts, at up to {100 * shares.max():.0f} % of how fast they do else: flags, "
        "schedule or frames are wrong, and forces that they hide may be no contact's.",
    )


@check(
    "a base that turns against its contacts",
    Does.MISREADS,
    1.6,
    says="The base turns otherwise than its closed contacts have it: …",
    means="The angular velocity of the base is in degrees, or what measures it is turned against "
    "the base otherwise than `[imu]` says.",
    do="Write the rotation that is told under `[imu]`, or convert the angular velocity.",
)
def find_turned_base(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return how the sensor of a base is turned or scaled against what closed contacts tell."""
    robot, pairs = logs.robot, []
    if robot.base is None:
        return ()
    for q, v, up, stands in _standing(logs):
        own = turn_by_contacts(robot.tree, robot.base, q, v, up, stands)
        known = np.isfinite(own).all(1)
        pairs.append((_centred(v[known, 3:SIX]), _centred(own[known])))
    told, own = (np.concatenate(x) for x in zip(*pairs, strict=True)) if pairs else (EMPTY, EMPTY)
    if len(own) < WINDOW:
        return ()
    turn, scale, before, after = _aligned(told, own)
    if before < RULES.contact_slips or after > before / 2:
        return ()
    if not 0.5 < scale < 2.0:
        degrees = np.degrees(1.0) / 2 < scale < 2 * np.degrees(1.0)
        why = "in degrees: convert 'base.gyro.x' … to rad/s" if degrees else "in another unit"
        return (
            "The base turns otherwise than its closed contacts have it: "
            f"{scale:.3g} times as fast, as if its angular velocity was {why}.",
        )
    rpy = pin.rpy.matrixToRpy((robot.base.imu.rotation @ turn).T)
    angle = np.degrees(np.linalg.norm(pin.log3(turn)))
    return (
        "The base turns otherwise than its closed contacts have it: as if what measures it was "
        f"turned by {angle:.0f}° against what its sidecar says; under [imu] write rotation = "
        f"[{', '.join(f'{x:.3f}' for x in rpy + 0.0)}], or correct the order or sign of its axes.",
    )


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
    for _ in range(WINDOW):
        U, size, Vt = np.linalg.svd(told[used].T @ own[used])
        sign = np.append([1.0, 1.0], np.sign(np.linalg.det(U @ Vt)))
        R, s = (U * sign) @ Vt, float(size @ sign / max((own[used] ** 2).sum(), 1e-300))
        error = np.linalg.norm(told - s * own @ R.T, axis=1)
        used = error <= np.median(error)
    speed = float(np.median(np.linalg.norm(told, axis=1))) or 1.0
    before = float(np.median(np.linalg.norm(told - own, axis=1)))
    return R, s, before / speed, float(np.median(error)) / speed


@check(
    "a sole that is said to be a point",
    Does.MISREADS,
    1.8,
    says="… flat on the ground while … against it: a sole transmits a moment, too",
    means="The contact transmits a moment, too, which enters the equations as if nothing did.",
    do='Write kind = "surface" for that contact.',
)
def find_soles(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which contacts at points stay flat, as soles do; nothing if none does."""
    robot = logs.robot
    contacts = () if robot.base is None else robot.base.contacts
    joints = [c.point.joint for c in contacts]  # corners of a sole share one
    alone = [c.kind == "point" and joints.count(c.point.joint) == 1 for c in contacts]
    turns = np.full(len(contacts), np.nan)
    for q, v, _, stands in _standing(logs):
        for k in np.flatnonzero(np.array(alone) & stands.any(0)):
            turns[k] = np.fmax(turns[k], flatness(robot.tree, q, v, contacts[k], stands[:, k]))
    flat = [c.name for c, x in zip(contacts, turns, strict=True) if x < RULES.contact_slips]
    if not flat:
        return ()
    stay, their = ("stays", "its leg turns") if len(flat) == 1 else ("stay", "the legs turn")
    return (
        f"{listing(flat, 4)} {stay} flat on the ground while {their} against it: a sole transmits "
        'a moment, too; write kind = "surface" under its [[contacts]].',
    )


@check(
    "what holds a base that does not fall",
    Does.MISREADS,
    1.4,
    says="…, and yet it does not fall: …",
    means="A contact or a measured force is not stated, flags are late or say the opposite, or a "
    "measured wrench is what the robot does to the ground.",
    do="State every `[[contacts]]` and `[[wrench]]`; look at flags, threshold, margin and signs.",
)
def find_unheld(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return what measured forces carry where no contact is closed; nothing if it is the robot."""
    robot, some = logs.robot, logs.motion
    fall = 0.0 if robot.base is None else float(np.linalg.norm(robot.base.gravity))
    if robot.base is None or not (fall and logs.weighs):
        return ()
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    open_ = ~(closed > 0.5).any(1)
    held = open_ & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(WINDOW, open_.sum() / 2):
        return ()
    needed = logs.predicted[held, :3]
    share = float((logs.torque[held, :3] * needed).sum() / (needed**2).sum())
    if share > 0.5:
        return ()
    name, when = robot.name, f"For {100 * held.mean():.0f} % of the time"
    if not (robot.base.contacts or robot.base.wrenches):
        return (
            f"Nothing is said to touch {name}, and yet it does not fall: state what holds it in "
            "the sidecar, [[contacts]] where nobody measures the force, [[wrench]] where a sensor "
            "does.",
        )
    if not robot.base.wrenches:
        return (
            f"{when} no contact of {name} is said to be closed, and yet it does not fall: flags "
            "are late (margin) or say the opposite, a threshold is not in the unit of its column, "
            "or a contact is not stated.",
        )
    why = "a sensor or contact is not stated, their unit is another one, or the file's masses are"
    if share < -0.5:
        why = "they are what the robot does to the ground: give them the opposite sign"
    return (
        f"{when} measured wrenches alone hold {name}, with {100 * share:.0f} % of what the file "
        f"needs there: as if {why}.",
    )


#: Samples of the windows that spectra are made of, and the highest of their frequencies that are
#: asked, next to half the sampling rate.
WINDOW, HIGHEST = 32, 4


@check(
    "impacts sampled without a low-pass",
    Does.MISREADS,
    10,
    says="The acceleration of the base in … comes in bursts that reach up to half the sampling "
    "rate",
    means="Feet hit the ground, and the sensor's ringing was sampled too slowly: what is above "
    "half the rate appears (aliased) as motion that never was.",
    do="Let acceleration, angular velocity and torque pass the same low-pass, below 0.4 of the "
    "sampling rate, before they are sampled; or sample faster. Such a log cannot be mended.",
)
def find_aliases(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return which logs hold impacts that were sampled without a low-pass; nothing if none does."""
    if logs.robot.base is None:
        return ()
    found: dict[str, float] = {}
    bands = {s.name: getattr(s, "band", None) for s in logs.samples}
    for _, log in logs.windows():
        if log.base is not None and len(log) > WINDOW:
            dt = sampling_step(log.t)
            cutoff = bands.get(log.name) or 0.5 / dt
            share = folded_share(log.base[:, ACC], dt, cutoff)
            found[log.name] = max(found.get(log.name, 0.0), share)
    # Intervals of a trot held up to .04 of the acceleration folded, not from .07 on.
    names = [name for name, share in found.items() if share > 0.06]
    if not names:
        return ()
    return (
        f"The acceleration of the base in {listing(names, 4)} comes in bursts that reach up to "
        f"half the sampling rate: of impacts sampled without a low-pass about "
        f"{100 * max(found.values()):.0f} % of it is folded into the band of the motion, where it "
        "cannot be told from motion; let acceleration, angular velocity and torque pass the same "
        "low-pass, below 0.4 of the sampling rate, before they are sampled, or sample faster.",
    )


def folded_share(x: Array, dt: float, cutoff: float) -> float:
    """Return which share (rms) of signals (N, k) below a cut-off [Hz] comes from aliases.

    A spectrum that was cut off before it was sampled has fallen to its noise at half the sampling
    rate; of one that was not, what lies just above is folded to just below. Noise is there all
    the time and impacts are not: what windows have there beyond the quietest of them is taken for
    aliases, and to reach down through the band as it is.
    """
    taper = np.hanning(WINDOW)
    parts = np.lib.stride_tricks.sliding_window_view(x, WINDOW, axis=0)[:: WINDOW // 2]
    Z = np.fft.rfft((parts - parts.mean(-1, keepdims=True)) * taper)[..., -HIGHEST - 1 : -1]
    power = (np.abs(Z) ** 2).mean(-1) * 2 / (WINDOW * (taper**2).sum())
    # This share of its mean;
    mean, noise = (
        power.mean(0),
        np.quantile(power, QUIET, axis=0) / 0.45,
    )
    # And what has so many times the mean of such noise is none.
    folded = np.where(mean > 2.0 * noise, mean - noise, 0.0).sum()
    reached = cutoff * dt * WINDOW
    return float(np.sqrt(folded * reached / max(x.var(0).sum(), 1e-300)))
