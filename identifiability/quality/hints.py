"""What is odd about prepared logs: torque in another unit, exchanged columns, what holds a base.

And what the robot file says that cannot be, and joints that say nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations, pairwise
from typing import TypeAlias

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.logs.commands import of_commands
from identifiability.logs.gaps import smallest_change
from identifiability.logs.prepare.dataset import stands_still
from identifiability.logs.rules import RULES
from identifiability.logs.spikes import TURN
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.quality.registry import Does, MeasuredLogs, check, without
from identifiability.robot import complete_motion

# Torque in another unit, or before a gear: its size beside what the robot file's masses ask for.
#
# At each joint the measured torque is regressed on what the file's masses predict, beside what any
# drive adds (friction, rotor inertia, offset); or on all that the file predicts, where it states
# the drive too. A file can be wrong, but hardly by a factor of `unit_factor`. One joint's alone is
# an alternative of the model (`workflows.alternatives`).


@check("unit", Does.EXPLAINS)
def find_torque_scale(logs: MeasuredLogs) -> list[Finding]:
    """Return torque whose size contradicts the file at all joints."""
    factors = measure_factors(logs) if logs.weighs else np.empty(0)
    share = factors[np.isfinite(factors)]
    most = np.log(RULES.unit_factor)
    if not len(share) or not (np.abs(np.log(share)) > most).all():
        return []
    how = phrase("unit", "alike" if np.ptp(np.log(share)) < most else "apart")
    multiple = " … ".join(dict.fromkeys(f"{x:.2g}" for x in (share.min(), share.max())))
    return [
        Finding(
            "unit",
            multiple=f"{multiple} times",
            how=how,
            factors=share.tolist(),
        )
    ]


def measure_factors(logs: MeasuredLogs) -> Array:
    """Return measured over predicted torque of each joint, (n,); NaN where it does not show."""
    factors = np.full(len(logs.joints), np.nan)
    size, units = np.sqrt(np.mean(logs.predicted**2, 0)), np.array(logs.robot.torque_units)
    offset = np.ones((len(logs.torque), 1))
    for k in range(len(factors)):
        # Else the masses of the file do not show.
        if size[k] >= 0.02 * size[units == units[k]].max() > 0:
            factors[k] = _slope(logs.predicted[:, k], logs.torque[:, k], logs.ordinary(k))
        if np.isnan(factors[k]) and np.isfinite(logs.stated[:, k]).all():
            factors[k] = _slope(logs.stated[:, k], logs.torque[:, k], offset)
    return factors


def _slope(predicted: Array, measured: Array, known: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each; NaN where it does not show."""
    p, m = without(predicted, known), without(measured, known)
    length, varies = float(np.linalg.norm(p)), float(np.linalg.norm(predicted - predicted.mean()))
    # What is known explains most of it, or the one hardly follows the other (correlation).
    hidden = length <= 0.3 * varies or p @ m < 0.7 * length * np.linalg.norm(m)
    return np.nan if hidden or not m.any() else float(p @ m) / length**2


# Joints that are exchanged, turn the other way round, or are in degrees, by what explains torque.
#
# Where the unpruned model explains a log badly, it is fitted to the same samples as if two joints
# had exchanged their positions, or positions and torque, or one were given with the other sign or
# in degrees. What `workflows.alternatives` finds in the torque columns alone is left to it.


#: Samples that are looked at, and joints beyond which only neighbours are tried.
ENOUGH_ROWS, MOST = 300, 8

#: Columns as they might have been meant: order and factors of positions, of torque columns, and
#: what is said of them; of the torque alone nothing is to be said here.
Meant: TypeAlias = tuple[list[int], Array, list[int], Array, str]


@check("exchanged", Does.MISREADS)
def find_exchanged(logs: MeasuredLogs) -> list[Finding]:
    """Return which joints are exchanged, turned, or in degrees."""
    robot, n = logs.robot, len(logs.joints)
    if robot.closed or robot.base is not None or n < 2:
        return []
    plain: Meant = ([*range(n)], np.ones(n), [*range(n)], np.ones(n), "")
    given = _error(logs, plain)
    # The unpruned model explains the log up to this relative error.
    if given <= 0.1:
        return []
    errors = [(_error(logs, meant), meant[-1]) for meant in _meant(logs, plain)]
    least, says = min(errors, key=lambda pair: pair[0])
    if least**2 >= RULES.unexplained * given**2 or not says:
        return []
    return [
        Finding(
            "exchanged",
            what=says,
            least=least,
            given=given,
        )
    ]


def _meant(logs: MeasuredLogs, plain: Meant) -> Iterator[Meant]:
    """Yield what the columns might have been meant to be."""
    names, n = logs.joints, len(logs.joints)
    say, (same, one, *_) = partial(phrase, "exchanged"), plain
    for i, j in combinations(range(n), 2) if n <= MOST else pairwise(range(n)):
        swap, pair = list(same), f"{names[i]} and {names[j]}"
        swap[i], swap[j] = j, i
        yield swap, one, same, one, say("positions", pair=pair)
        yield swap, one, swap, one, say("joints", pair=pair)
        yield same, one, swap, one, ""
    for k, joint in enumerate(names):
        turned, small = np.array(one), np.array(one)
        turned[k], small[k] = -1.0, np.pi / 180
        yield same, turned, same, one, say("sign", joint=joint)
        yield same, turned, same, turned, say("way", joint=joint)
        yield same, one, same, turned, ""
        if not logs.robot.is_prismatic(int(logs.robot.actuated[k])):
            yield same, small, same, one, say("angle", joint=joint)
    for shift in range(1, n):
        yield same, one, same[shift:] + same[:shift], one, ""


def _error(logs: MeasuredLogs, meant: Meant) -> float:
    """Return the relative error of the unpruned model with an offset a joint, joints alike."""
    order, factor, torques, signs, _ = meant
    stride = max(1, len(logs.torque) // ENOUGH_ROWS)
    some, tau = logs.motion[::stride], logs.torque[::stride, torques] * signs
    spread = tau.std(0)
    if not (spread > 0).all():
        return 0.0
    given, structure = (some.actuated_q, some.actuated_v, some.actuated_a), logs.structure
    try:
        motion = complete_motion(logs.robot, some.t, *(x[:, order] * factor for x in given))
    except ClosureError:
        return np.inf
    W = structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept]
    return unexplained(W / spread[:, None], tau / spread)


def unexplained(W: Array, tau: Array) -> float:
    """Return what a regressor (m, n, p) and offsets leave of torque (m, n), as a share."""
    m, n, p = W.shape
    if m * n < 2 * (p + n):
        return 0.0
    A, b = (W - W.mean(0)).reshape(m * n, p), (tau - tau.mean(0)).ravel()
    length = np.linalg.norm(A, axis=0)
    A = A / np.where(length > 0, length, 1.0)
    fit = np.linalg.lstsq(A.T @ A, A.T @ b, rcond=ROUNDOFF)[0]
    return float(np.linalg.norm(b - A @ fit) / np.linalg.norm(b))


# Torque that stops at an extreme value: what a drive was asked for beyond it is not in the log.


@check("flat", Does.HINTS)
def find_saturation(logs: MeasuredLogs) -> list[Finding]:
    """Return torque columns that stay at their extreme values while the robot moves."""
    found: dict[str, str] = {}
    for rows in (log.shown for log in logs.recordings if not of_commands(log)):
        moves = np.append(np.diff(rows.q, axis=0).any(1), True)
        for joint, x in zip(rows.joints, rows.tau[moves].T, strict=True):
            band = max(0.01 * float(np.ptp(x)), 1.5 * float(smallest_change(x[:, None])[0]))
            for top in (x.max(), x.min()) if band else ():
                at, near = x == top, np.count_nonzero(np.abs(x - top) <= band)
                share, lasts = at.mean(), at[3:] & at[2:-1] & at[1:-2] & at[:-3]
                # It is met this often in all, and so much more often than what is next to it.
                if share >= 0.005 and lasts.any() and at.sum() > 6 * (near - at.sum()):
                    found[joint] = phrase(
                        "flat",
                        "one",
                        joint=joint,
                        value=top,
                        share=share,
                    )
    columns = tuple(f"{joint}.tau" for joint in found)
    return (
        [
            Finding(
                "flat",
                where=[*found.values()],
                columns=columns,
            )
        ]
        if found
        else []
    )


# What is odd about the robot file, and about joints that say nothing: asked of any logs.


@check("bodies", Does.HINTS, always=True)
def find_bodies(logs: MeasuredLogs) -> list[Finding]:
    """Return the bodies of the file that cannot exist."""
    text = find_impossible_bodies(logs.robot)
    return [Finding("bodies", text)] if text else []


@check("assembly", Does.HINTS, always=True)
def find_assembly(logs: MeasuredLogs) -> list[Finding]:
    """Return how loops were closed that the file leaves open."""
    text = logs.robot.describe_assembly()
    return [Finding("assembly", text)] if text else []


@check("outside", Does.HINTS, always=True)
def find_outside(logs: MeasuredLogs) -> list[Finding]:
    """Return the bodies that were left out."""
    robot = logs.robot
    return [Finding("outside", robot.path.name, bodies=robot.outside)] if robot.outside else []


@check("beyond", Does.HINTS, always=True)
def find_beyond(logs: MeasuredLogs) -> list[Finding]:
    """Return the joints that move beyond the limits that the file states, but for whole turns."""
    limits, q = logs.robot.limits, logs.motion.actuated_q
    low, high = limits.T
    if not len(q) or q.shape[1] != len(low):
        return []
    turns = np.array([not logs.robot.is_prismatic(int(k)) for k in logs.robot.actuated])
    middle = np.where(np.isfinite(limits), limits, 0.0).mean(1)
    away = np.median(q, 0) - middle
    q = q - TURN * turns * np.round(away / TURN)
    least, most = q.min(0), q.max(0)
    slack = RULES.small * (high - low)
    far = (least < low - slack) | (most > high + slack)
    names = np.array(logs.robot.joints)
    said = []
    for joint, *ends in zip(names[far], least[far], most[far], low[far], high[far], strict=True):
        said.append("{} ({:.3g} … {:.3g}, limits {:.3g} … {:.3g})".format(joint, *ends))
    return [Finding("beyond", joints=said)] if said else []


@check("still", Does.HINTS, always=True)
def find_still(logs: MeasuredLogs) -> list[Finding]:
    """Return the joints that stand still."""
    surveys = [s.survey for s in logs.samples]
    idle, rows = stands_still(surveys), np.sum([s.rows for s in surveys], axis=0)
    still = [j for j, r, s in zip(logs.joints, rows, idle, strict=True) if not r and s]
    if not (still and any(s.outputs for s in surveys)):
        return []
    at = dict(zip(logs.robot.joints, np.median(logs.motion.actuated_q, 0), strict=True))
    locks = " ".join(f"--lock {j}={at[j]:.4g}" for j in still if j in at)
    columns = tuple(f"{j}.tau" for j in still)
    locks = f" ({locks})" if locks else ""
    return [
        Finding(
            "still",
            joints=still,
            locks=locks,
            rows="all",
            columns=columns,
        )
    ]


# Contacts of a robot that floats: does it stay up by those that are closed?


@check("unheld", Does.MISREADS)
def find_unheld(logs: MeasuredLogs) -> list[Finding]:
    """Return what measured forces carry where no contact is closed; nothing if it is the robot."""
    robot, some = logs.robot, logs.motion
    fall = 0.0 if robot.base is None else float(np.linalg.norm(robot.base.gravity))
    if robot.base is None or not (fall and logs.weighs):
        return []
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    free = ~(closed > 0.5).any(1)
    held = free & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(RULES.fewest, free.sum() / 2):
        return []
    needed = logs.predicted[held, :3]
    share = float((logs.torque[held, :3] * needed).sum() / (needed**2).sum())
    if share > 0.5:
        return []
    which = "wrenches" if robot.base.wrenches else "closed" if robot.base.contacts else "nothing"
    cause = phrase("unheld", "opposite" if share < -0.5 else "less")
    told = {"name": robot.name, "share": 100 * held.mean(), "held": 100 * share, "cause": cause}
    return [Finding("unheld", why=phrase("unheld", which, **told))]
