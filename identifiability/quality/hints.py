"""Checks of prepared logs: torque in another unit, the support of a base.

They also find torque that was copied from another column, impossible values in the robot file, and
joints without information.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimate import Outliers, weigh_outliers
from identifiability.estimation.estimator import Estimator
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import ROUNDOFF, rms_of
from identifiability.foundation.names import Array, name_each
from identifiability.foundation.quoting import option_for_shell, toml_key
from identifiability.foundation.rounding import REACH
from identifiability.logs.gaps import smallest_change
from identifiability.logs.names import UNITS
from identifiability.logs.prepare.dataset import Dataset, stands_still
from identifiability.logs.rows import divide_rows, gather
from identifiability.logs.rules import RULES
from identifiability.logs.spikes import TURN
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.physical.plausibility import check_plausible
from identifiability.regression.information import Information
from identifiability.robot import Robot

from .registry import Does, MeasuredLogs, check, without

# Torque in another unit, or before a gear: compare its size with the robot file's prediction.
#
# At each joint the measured torque is regressed on the prediction by the file's masses and on the
# columns of any drive (friction, rotor inertia, offset). If the file also states the drive, the
# regressor is its whole prediction. A file can be wrong, but hardly by a factor of `unit_factor`.
# A factor at one joint alone is a reading of the logs (`reading`), if other joints show it.


@check("effects", Does.HINTS, always=True)
def find_left_out_effects(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield effects that the sidecar asks for and another model has not."""
    own = [e for e in logs.robot.said.effects if e not in logs.structure.model.texts]
    if own:
        yield Finding("effects", effects=own)


@check("unit", Does.EXPLAINS)
def find_torque_scale(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding if the scale of torque contradicts the file at every joint that shows it."""
    factors = measure_factors(logs)
    share = factors[np.isfinite(factors)]
    most = np.log(RULES.unit_factor)
    shows = 2 * len(share) >= len(factors) > 0
    if not shows or not (np.abs(np.log(share)) > most).all():
        return
    how = "alike" if np.ptp(np.log(share)) < most else "apart"
    # A column in mA or mN·m was read as A or N·m.
    milli = np.abs(np.log(share * UNITS["mA"][1])) < most
    if how == "alike" and milli.all():
        how = "milli"
    ends = (share.min(), share.max())
    multiple = " … ".join(dict.fromkeys(f"{x:.2g}" for x in ends))
    first = toml_key(logs.joints[0])
    said = phrase("unit", how, first=first)
    yield Finding("unit", multiple=f"{multiple} times", how=said, factors=share.tolist())


@check("joint_unit", Does.HINTS)
def find_joint_unit(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield each joint whose torque contradicts the file by a factor, if all others agree."""
    factors = measure_factors(logs)
    known = np.isfinite(factors) & (factors > 0)
    apart = np.abs(np.log(np.where(known, factors, 1.0)))
    odd = np.flatnonzero(apart > np.log(RULES.unit_factor)).tolist()
    agreeing = int(known.sum()) - len(odd)
    # One joint contradicts the others; the file is not wrong at most joints.
    if len(odd) > agreeing:
        return
    for k in odd:
        joint = logs.joints[k]
        columns = (f"{joint}.tau",)
        numbers = {"factor": float(factors[k]), "limit": RULES.unit_factor}
        yield Finding("joint_unit", joint=joint, columns=columns, **numbers)


def measure_factors(logs: MeasuredLogs) -> Array:
    """Return measured over predicted torque of each joint, (n,); NaN if the data do not show it."""
    factors = np.full(len(logs.joints), np.nan)
    if not logs.weighs:
        return factors
    size = rms_of(logs.predicted, axis=0)
    units = np.array(logs.robot.torque_units)
    offset = np.ones((len(logs.torque), 1))
    for k in range(len(factors)):
        # Else the masses of the file do not show.
        if size[k] >= 0.02 * size[units == units[k]].max() > 0:
            predicted = logs.predicted[:, k]
            torque = logs.torque[:, k]
            factors[k] = _slope(predicted, torque, logs.ordinary(k))
        if np.isnan(factors[k]) and np.isfinite(logs.stated[:, k]).all():
            factors[k] = _slope(logs.stated[:, k], logs.torque[:, k], offset)
    return factors


def _slope(predicted: Array, measured: Array, known: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each; NaN if data do not show it."""
    p = without(predicted, known)
    m = without(measured, known)
    length = float(np.linalg.norm(p))
    varies = float(np.linalg.norm(predicted - predicted.mean()))
    # The known part explains most of it, or the two are hardly correlated.
    hidden = length <= 0.3 * varies or p @ m < 0.7 * length * np.linalg.norm(m)
    if hidden or not m.any():
        return np.nan
    return float(p @ m) / length**2


# Torque that saturates: the log lacks the torque that the drive requested beyond the limit.


@check("flat", Does.HINTS)
def find_saturation(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield torque columns that stay at their extreme values while the robot moves."""
    found = {}
    for rows in logs.measured:
        moves = np.append(np.diff(rows.q, axis=0).any(1), True)
        for joint, x in zip(rows.joints, rows.tau[moves].T, strict=True):
            of_range = 0.01 * float(np.ptp(x))
            of_steps = float(smallest_change(x[:, None])[0])
            band = max(of_range, 1.5 * of_steps)
            for top in (x.max(), x.min()) if band else ():
                at = x == top
                near = np.count_nonzero(np.abs(x - top) <= band)
                share = at.mean()
                lasts = at[3:] & at[2:-1] & at[1:-2] & at[:-3]
                # The value occurs this often in all, and this much more often than its neighbours.
                if share >= 0.005 and lasts.any() and at.sum() > 6 * (near - at.sum()):
                    found[joint] = phrase("flat", "one", joint=joint, value=top, share=share)
    columns = tuple(f"{joint}.tau" for joint in found)
    if found:
        yield Finding("flat", where=[*found.values()], columns=columns)


# Drives that are off: currents read zero, and brakes or shorted windings stop the robot.


@check("off", Does.HINTS)
def find_off(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield stretches in which every torque is zero on average, and a joint still moves."""
    places = []
    for rows in logs.measured:
        split = np.array_split(np.arange(len(rows.t)), 100)
        parts = [part for part in split if len(part)]
        level = np.array([rows.tau[part].mean(0) for part in parts])
        # Currents of drives that are off read zero, up to a twentieth of the usual torque.
        quiet = (np.abs(level) < 0.05 * rms_of(level, axis=0)).all(1)
        edges = np.flatnonzero(np.diff(quiet, prepend=False, append=False)).reshape(-1, 2)
        for start, stop in edges[np.diff(edges)[:, 0] >= 4]:
            at = np.concatenate(parts[start:stop])
            # It moves by more than a sensor's noise.
            moves = np.ptp(rows.q[at], axis=0) > 0.01 * np.ptp(rows.q, axis=0)
            if moves.any():
                first, last = rows.t[at[[0, -1]]]
                places.append(phrase("off", "one", log=rows.name, first=first, last=last))
    if places:
        yield Finding("off", where=places)


@check("copied", Does.MISREADS)
def find_copied_torque(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield pairs of torque columns that are multiples of each other while the joints are not."""
    columns: dict[str, None] = {}
    for rows in logs.measured:
        same_torque, same_motion = (_correlate(x) > 1 - ROUNDOFF for x in (rows.tau, rows.q))
        copied = np.triu(same_torque & ~same_motion, 1)
        for pair in np.argwhere(copied).tolist():
            columns |= dict.fromkeys(f"{rows.joints[k]}.tau" for k in pair)
    if columns:
        yield Finding("copied", columns=[*columns])


def _correlate(x: Array) -> Array:
    """Return the absolute correlations of columns (N, n), (n, n); zero where one is constant."""
    varies = x - x.mean(0)
    size = np.linalg.norm(varies, axis=0)
    varies /= np.where(np.ptp(x, axis=0) > 0, size, np.inf)
    return np.abs(varies.T @ varies)


# Problems of the robot file, and joints without information; checked for any logs.


@check("bodies", Does.HINTS, always=True)
def find_bodies(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield the bodies of the file that cannot exist."""
    text = find_impossible_bodies(logs.robot)
    if text:
        yield Finding("bodies", text)


@check("dense", Does.HINTS, always=True)
def find_implausible(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield implausible inertias and lengths of the robot file, and legs on a fixed base."""
    yield from check_plausible(logs.robot)


@check("assembly", Does.HINTS, always=True)
def find_assembly(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield how loops were closed that the file leaves open."""
    text = logs.robot.describe_assembly()
    if text:
        yield Finding("assembly", text)


@check("outside", Does.HINTS, always=True)
def find_outside(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding on the bodies of the scene that were left out."""
    robot = logs.robot
    if robot.outside:
        yield Finding("outside", robot.path.name, bodies=robot.outside)


@check("springs", Does.HINTS, always=True)
def find_sprung_joints(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding on springs of the robot file between motors and links."""
    robot = logs.robot
    joints = [*robot.springs]
    if joints:
        yield Finding("springs", robot.path.name, joints=joints)


@check("beyond", Does.HINTS, always=True)
def find_beyond(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield the joints that move beyond the limits that the file states, but for whole turns."""
    limits = logs.robot.limits
    q = logs.motion.actuated_q
    low, high = limits.T
    if not len(q) or q.shape[1] != len(low):
        return
    turns = ~logs.robot.slides
    middle = np.where(np.isfinite(limits), limits, 0.0).mean(1)
    away = np.median(q, 0) - middle
    q = q - TURN * turns * np.round(away / TURN)
    least = q.min(0)
    most = q.max(0)
    slack = RULES.small * (high - low)
    far = (least < low - slack) | (most > high + slack)
    names = np.array(logs.robot.joints)
    said = []
    for joint, *ends in zip(names[far], least[far], most[far], low[far], high[far], strict=True):
        said.append("{} ({:.3g} … {:.3g}, limits {:.3g} … {:.3g})".format(joint, *ends))
    if said:
        yield Finding("beyond", joints=said)


@check("lengths", Does.MISREADS)
def find_lengths(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding if the positions of a parallel robot are the lengths of its legs.

    The file's zero is where the legs are drawn. A stated zero is not questioned.
    """
    robot = logs.robot
    known = {*robot.joints} & robot.scales.keys()
    if known or robot.cables or not robot.loops or not robot.slides.all():
        return
    q = logs.motion.actuated_q
    drawn = measure_legs(robot)
    span = np.ptp(q, axis=0)
    zero = [robot.home_table[joint] for joint in robot.joints]
    near = np.abs(np.median(q, 0) - drawn) < span
    away = np.abs(q - zero).min(0) > span
    if (near & away).all():
        which = '"*"' if np.allclose(drawn, drawn[0]) else toml_key(robot.joints[0])
        yield Finding("lengths", joints=robot.joints, which=which, drawn=float(drawn[0]))


def measure_legs(robot: Robot) -> Array:
    """Return how far apart the ends of each leg are drawn where its slide is at zero, (n,) [m].

    Of a slide behind which no joint follows and no loop closes, such as a finger, it is NaN.
    """
    tree = robot.tree.joints
    ends = {joint.parent: joint.translation for joint in tree}
    ends |= {p.joint: p.position for loop in robot.loops for p in (loop.first, loop.second)}
    legs = {
        j.dofs[0]: j.translation + j.rotation @ ends[k] for k, j in enumerate(tree) if k in ends
    }
    none = np.full(3, np.nan)
    return np.linalg.norm([legs.get(name, none) for name in robot.joints], axis=1)


@check("still", Does.HINTS, always=True)
def find_still(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding on joints that never move."""
    surveys = [s.survey for s in logs.samples]
    idle = stands_still(surveys)
    rows = np.sum([s.rows for s in surveys], axis=0)
    states = zip(logs.joints, rows, idle, strict=True)
    still = [j for j, r, s in states if not r and s]
    if not (still and any(s.outputs for s in surveys)):
        return
    medians = np.median(logs.motion.actuated_q, 0)
    at = name_each(logs.robot.joints, medians)
    places = [f"{joint}={at[joint]:.4g}" for joint in still if joint in at]
    locks = " ".join(option_for_shell("--lock", place) for place in places)
    columns = tuple(f"{j}.tau" for j in still)
    locks = f" ({locks})" if locks else ""
    yield Finding("still", joints=still, locks=locks, rows="all", columns=columns)


# Contacts of a robot that floats: does it stay up by those that are closed?


@check("unheld", Does.MISREADS)
def find_unheld(logs: MeasuredLogs) -> Iterator[Finding]:
    """Yield a finding if neither a closed contact nor a measured force carries the robot."""
    robot = logs.robot
    base = robot.base
    some = logs.motion
    fall = 0.0 if base is None else float(np.linalg.norm(base.gravity))
    if base is None or not (fall and logs.weighs):
        return
    closed = np.zeros((len(some), 0)) if some.touch is None else some.touch[:, 3:]
    free = ~(closed > 0.5).any(1)
    held = free & (np.linalg.norm(some.a[:, :3], axis=1) > fall / 2)
    if held.sum() < max(RULES.fewest, free.sum() / 2):
        return
    needed = logs.predicted[held, :3]
    work = (logs.torque[held, :3] * needed).sum()
    needed_work = (needed**2).sum()
    share = float(work / needed_work)
    if share > 0.5:
        return
    which = "wrenches" if base.wrenches else "closed" if base.contacts else "nothing"
    cause = phrase("unheld", "opposite" if share < -0.5 else "less")
    percent = {"share": 100 * held.mean(), "held": 100 * share}
    why = phrase("unheld", which, name=robot.name, cause=cause, **percent)
    yield Finding("unheld", why=why)


# Rows that lie out: they are weighed down in the fit, and are no data where names are looked for.


@check("outliers", Does.WEIGHS)
def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Dataset],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str, Outliers | None]:
    """Return the information with outliers down-weighted, a sentence, and the outliers.

    The sentence names the parameter that outliers would move most, if that is out of its interval.
    Outliers with negligible residuals are ignored, because a low-pass leaves some at the ends of a
    log without noise.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Dataset
        The logs that are fitted.
    information : Information
        About all columns.
    estimator : Estimator
    """
    weighed, found = weigh_outliers(information, replace(estimator, noise=None))
    if found is None or found.share < RULES.negligible:
        return weighed, "", None
    if found.moved.max() <= REACH:
        return weighed, "", found
    most = int(np.argmax(found.moved))
    where = where_outlying(joints, samples, found)
    told = {"parameter": information.columns[most], "moved": float(found.moved[most])}
    farthest = int(np.argmax(found.beyond.max(0)))
    columns = (f"{joints[farthest]}.tau",)
    rows = int((found.last - found.first).sum())
    said = Finding("outliers", where=where, rows=rows, columns=columns, **told)
    return weighed, said, found


def leave_out_rows(
    samples: Sequence[Dataset], found: Outliers, outputs: Sequence[Dataset] = ()
) -> tuple[Dataset, ...]:
    """Return samples with zero weight in outlier segments, as at rest.

    Parameters
    ----------
    samples : sequence of Dataset
    found : Outliers
    outputs : sequence of Dataset, optional
        Samples of the same logs whose outputs `found` refers to; by default `samples`.
    """
    out = []
    for k, (s, of) in enumerate(zip(samples, outputs or samples, strict=False)):
        at = of.output_times()
        own = found.log == k
        beside = at[1] - at[0]
        first = at[found.first[own]] - beside
        last = at[found.last[own] - 1] + beside
        out.append(replace(s, **gather(_weights_outside(s, first, last))))
    return tuple(out)


def _weights_outside(samples: Dataset, first: Array, last: Array) -> Iterator[dict[str, Array]]:
    """Yield weights of samples, piece by piece: zero in segments, and where they were zero.

    Parameters
    ----------
    samples : Dataset
    first, last : (k,) [s]
        Times of the first and the last sample of each segment.
    """
    for a, b in divide_rows(len(samples.tau)):
        t = samples.motion.t[a:b]
        weight = (samples.weight[a:b] > 0).astype(float)
        starts = np.searchsorted(t, first)
        stops = np.searchsorted(t, last, side="right")
        for start, stop in zip(starts, stops, strict=True):
            weight[start:stop] = 0.0
        yield {"weight": weight}


def where_outlying(joints: Sequence[str], samples: Sequence[Dataset], found: Outliers) -> str:
    """Return the place of the farthest outlier, and its distance from the model."""
    at, worst = divmod(int(found.beyond.argmax()), len(joints))
    log = samples[int(found.log[at])]
    other_log = np.diff(found.log) != 0
    behind = found.first[1:] > found.last[:-1]
    new = other_log | behind
    place = np.cumsum([False, *new])
    own = place == place[at]
    first, last = found.first[own], found.last[own]
    ends = log.output_times(np.array([first[0], last[-1] - 1]))
    start, stop = (f"{end:.5g}" for end in ends)
    times = f"At t = {start} s" if start == stop else f"From t = {start} to {stop} s"
    far = float(np.sqrt(found.beyond[at, worst]))
    size = [np.abs(s.tau[s.at_outputs, worst]) for s in samples]
    parts = zip(found.log, found.first, found.last, strict=True)
    outlying = np.concatenate([size[k][a:b] for k, a, b in parts])
    most = np.median(outlying) > np.quantile(np.concatenate(size), RULES.nearly_all)
    return phrase(
        "outliers",
        "limit" if most else "where",
        log=log.name,
        times=times,
        joint=joints[worst],
        far=far,
    )
