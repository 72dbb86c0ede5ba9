"""What is odd about the robot file, and about joints that say nothing: asked of any logs."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.numbers import percent
from identifiability.logs.prepare.dataset import stands_still
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check


@check(
    "bodies that cannot exist",
    Does.HINTS,
    51,
    always=True,
    says="The robot file states a body that cannot exist. …",
    means="A mass or moment of the file is negative, or its moments violate the triangle "
    "inequality: no density has them.",
    do="Correct `<inertial>` of that body; the nearest real robot and its prior rest on it.",
)
def find_bodies(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on bodies of the file that cannot exist, or none."""
    return tuple(filter(None, [find_impossible_bodies(logs.robot)]))


@check(
    "a closing position that was computed",
    Does.HINTS,
    52,
    always=True,
    says="… states no home position: the nearest one that closes its loops is used (…)",
    means="A closed chain can be assembled in several ways, and the file does not say in which "
    "it is.",
    do='State the home position: `<key name="home">` in an MJCF, `[home]` in the sidecar.',
)
def find_assembly(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on how loops were closed that the file leaves open, or none."""
    return tuple(filter(None, [logs.robot.describe_assembly()]))


@check(
    "noise that turns velocities",
    Does.HINTS,
    53,
    always=True,
    says="Noise turns the sign of the velocity in … at up to … of the samples",
    means="Near standstill the measured speed is noise; the direction of dry friction is then "
    "taken of the smoothed speed.",
    do="Nothing must be done. A better speed sensor, or faster motion, tells more of Coulomb "
    "friction.",
)
def find_turned_signs(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return where measured and smoothed velocity disagree in sign; nothing if noise is small."""
    turned = np.zeros(len(logs.joints))
    for s in logs.samples:
        motion = s.motion
        if motion.smooth_v is not None:
            apart = np.sign(motion.actuated_v) != np.sign(motion.smooth_v[:, 0])
            turned = np.maximum(turned, apart.mean(0))
    # Share of the samples at which noise turns the sign of a velocity that is said.
    at = [f"'{j}.dq'" for j, x in zip(logs.joints, turned, strict=True) if x > 0.01]
    if not at:
        return ()
    return (
        f"Noise turns the sign of the velocity in {listing(at, 4)} at up to "
        f"{percent(turned.max(), 2)} of the samples: the direction of friction is taken of the "
        "smoothed velocity; one that is measured with less noise tells more of it.",
    )


@check(
    "bodies that no joint reaches",
    Does.HINTS,
    54,
    always=True,
    says="Of …, … and what hangs there was left out: no actuated joint reaches it.",
    means="The scene holds objects (a table, a free cube) that are no part of the robot.",
    do="Nothing, unless a joint's actuator is missing: name it in `<actuator>`, or by "
    "`actuated` in the sidecar.",
)
def find_outside(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on bodies that were left out, or none."""
    robot = logs.robot
    if not robot.outside:
        return ()
    return (
        f"Of {robot.path.name}, {listing(robot.outside, 6)} and what hangs there was left out: "
        "no actuated joint reaches it.",
    )


@check(
    "joints that never move",
    Does.HINTS,
    56,
    always=True,
    says="… never moves in these logs, so its torque is no data",
    means="At rest dry friction takes any torque, so that nothing about that joint follows.",
    do="Move the joint in a log, or lock it: `--lock elbow=0.3`.",
)
def find_still(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on joints that stand still, or none."""
    surveys = [s.survey for s in logs.samples]
    idle, rows = stands_still(surveys), np.sum([s.rows for s in surveys], axis=0)
    still = [j for j, r, s in zip(logs.joints, rows, idle, strict=True) if not r and s]
    if not (still and any(s.outputs for s in surveys)):
        return ()
    at = dict(zip(logs.robot.joints, np.median(logs.motion.actuated_q, 0), strict=True))
    locks = " ".join(f"--lock {j}={at[j]:.4g}" for j in still if j in at)
    return (
        f"{listing(still, 6)} never moves in these logs, so its torque is no data: dry "
        f"friction makes it anything. Lock it{f' ({locks})' if locks else ''}, log motion of it, "
        "or keep it (Preparation(keep_rest=True)) if it has no dry friction.",
    )
