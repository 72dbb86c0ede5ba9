"""What is odd about torque: unit, sign, joint, side of a gear, weight, flat tops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from itertools import combinations, pairwise

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.commands import of_commands
from identifiability.logs.gaps import smallest_change
from identifiability.quality.registry import Does, MeasuredLogs, check, without
from identifiability.quality.rules import RULES
from identifiability.robot import Motion, complete_motion

# Torque in another unit, or before a gear: its size beside what the robot file's masses ask for.
#
# At each joint the measured torque is regressed on what the file's masses predict, beside what any
# drive adds (friction, rotor inertia, offset); or on all that the file predicts, where it states
# the drive too. A file can be wrong, but hardly by a factor of `unit_factor`.


#: Units of torque that people give, and how many of them make one N·m or N.
UNITS = {"mN·m (or mN)": 1e3, "N·cm": 1e2, "N·mm": 1e3, "kN·m (or kN)": 1e-3}


@check("unit", Does.EXPLAINS)
def find_torque_scale(logs: MeasuredLogs) -> list[Finding]:
    """Return torque whose size contradicts the file: at all joints, or far more at one of them."""
    if not logs.weighs:
        return []
    factors = measure_factors(logs)
    known = np.flatnonzero(np.isfinite(factors))
    share = factors[known]
    odd = np.abs(np.log(share)) > np.log(RULES.unit_factor)
    # No other body makes the torque of one joint alone so much larger or smaller.
    other = np.abs(np.log(share)) > 2.0 * np.log(RULES.unit_factor)
    if other.sum() < len(share) and (odd == other).all() and other.any():
        k = int(np.flatnonzero(other)[0])
        how = phrase("unit", "one", joint=logs.joints[known[k]], name=_name_unit(share[k]))
        return [Finding("unit", multiple=f"{share[k]:.2g} times", how=how, factors=share.tolist())]
    # Factors of two joints do not differ by more than this.
    apart = not odd.any() and len(share) > 1 and share.max() >= 8.0 * share.min()
    if not len(share) or not (odd.all() or apart):
        return []
    middle = float(np.exp(np.median(np.log(share))))
    how = phrase("unit", "apart")
    # Factors of all joints are one unit if they lie within this factor of their middle.
    if (np.abs(np.log(share / middle)) < np.log(1.5)).all():
        how = phrase("unit", "alike", name=_name_unit(middle))
    low, high = (f"{x:.2g}" for x in (share.min(), share.max()))
    multiple = f"{low} times" if low == high else f"{low} … {high} times"
    return [Finding("unit", multiple=multiple, how=how, factors=share.tolist())]


def _name_unit(factor: float) -> str:
    names = [u for u, f in UNITS.items() if 1 / 2 < factor / f < 2]
    return f", as if it were in {' or '.join(names)}" if names else ""


def measure_factors(logs: MeasuredLogs) -> Array:
    """Return measured over predicted torque of each joint, (n,); NaN where it does not show."""
    factors = np.full(len(logs.joints), np.nan)
    size = np.sqrt(np.mean(logs.predicted**2, 0))
    units = np.array(logs.robot.torque_units)
    for k in range(len(factors)):
        # Where masses make less than this share of the largest torque among like joints, they do
        # not show.
        if size[k] >= 0.02 * size[units == units[k]].max() > 0:
            factors[k] = _factor(logs.predicted[:, k], logs.torque[:, k], logs.ordinary(k))
        if np.isnan(factors[k]) and np.isfinite(logs.stated[:, k]).all():
            factors[k] = _plain_factor(logs.stated[:, k], logs.torque[:, k])
    return factors


def _plain_factor(predicted: Array, measured: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each, beside an offset; or NaN."""
    p, m = predicted - predicted.mean(), measured - measured.mean()
    lengths = float(np.linalg.norm(p)), float(np.linalg.norm(m))
    # All that the file predicts agrees with the measured torque from this correlation on,
    # where masses alone do not show.
    if not min(lengths) > 0 or float(p @ m) < 0.9 * lengths[0] * lengths[1]:
        return np.nan
    return float(p @ m) / lengths[0] ** 2


def _factor(predicted: Array, measured: Array, ordinary: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each; NaN where it does not show."""
    kept = np.ones(len(predicted), bool)
    slope = np.nan
    # Rounds of the regression in which the worst twentieth of the samples is left out.
    for _ in range(3):
        p = without(predicted[kept], ordinary[kept])
        m = without(measured[kept], ordinary[kept])
        varies = np.linalg.norm(predicted[kept] - predicted[kept].mean())
        length = np.linalg.norm(p)
        # Share of the predicted torque that must not look like friction, rotor inertia
        # and offset.
        if not length > 0.3 * varies or not np.linalg.norm(m) > 0:
            return np.nan
        slope = float(p @ m) / float(length**2)
        # The measured torque must follow the predicted one with this correlation, at that
        # joint.
        if float(p @ m) / float(length * np.linalg.norm(m)) < 0.7:
            return np.nan
        left = np.zeros(len(predicted))
        left[kept] = np.abs(m - slope * p)
        # Rounds of the regression in which the worst twentieth of the samples is left
        # out.
        kept &= left <= np.quantile(left[kept], 0.95)
    return slope if slope > 0 else np.nan


# Torque that stops at an extreme value: what a drive was asked for beyond it is not in the log.


#: An extreme value is a flat top if the column stays there so long once [samples].
RUN = 4

#: Width of the bands, of the column's range.
BAND: Tolerance = 0.01


@check("flat", Does.HINTS)
def find_saturation(logs: MeasuredLogs) -> list[Finding]:
    """Return torque columns with flat tops."""
    found: dict[str, tuple[float, float]] = {}
    for _, log in logs.windows():
        if of_commands(log):  # a servo's own limit, and no data there
            continue
        moves = np.append(np.abs(np.diff(log.q, axis=0)).max(1, initial=0.0) > 0, True)
        for k, joint in enumerate(log.joints):
            column = log.tau[moves, k]
            for side in (1.0, -1.0):
                share = flat_share(side * column)
                if share > found.get(joint, (0.0, 0.0))[0]:
                    found[joint] = share, side * float((side * column).max())
    said = [
        phrase("flat", "one", joint=joint, value=value, share=share)
        for joint, (share, value) in found.items()
    ]
    columns = tuple(f"{joint}.tau" for joint in found)
    return [Finding("flat", where=said, columns=columns)] if found else []


def flat_share(x: Array) -> float:
    """Return which share of a column (N,) lies on a flat top, 0 if it has none."""
    if not len(x) or not np.ptp(x) > 0:
        return 0.0
    top, width = float(x.max()), float(np.ptp(x))
    resolution = float(smallest_change(x[:, None])[0])
    at = x >= top - 0.5 * min(resolution, BAND * width)
    share = float(at.mean())
    band = max(BAND * width, 1.5 * resolution)
    below = np.count_nonzero((x >= top - band) & ~at) / len(x)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(int), [0]])))
    longest = int((edges[1::2] - edges[::2]).max())
    # A flat top is met this often in all.
    # It is met so many times as often as the next band of the same width.
    flat = share >= 0.005 and longest >= RUN and share > 6.0 * below
    return share if flat else 0.0


# Joints that are exchanged, turn the other way round, or are in degrees, by what explains torque.
#
# Where the unpruned model explains a log badly, it is fitted to the same samples as if two joints
# had exchanged their positions, or positions and torque, or one were given with the other sign or
# in degrees. What `workflows.alternatives` finds in the torque columns alone is left to it.


#: Samples that are looked at, and joints beyond which only neighbours are tried.
ENOUGH_ROWS, MOST = 300, 8

DEGREE = np.pi / 180


@frozen
class _Change:
    """Columns of positions and torque as they might have been meant.

    `order` and `factor` are those of positions, `torques` and `signs` those of torque columns;
    `says` is for "the unpruned model would err by …"; without it nothing is to be said here.
    """

    order: tuple[int, ...]
    factor: tuple[float, ...]
    torques: tuple[int, ...]
    signs: tuple[float, ...]
    says: str = ""


@check("exchanged", Does.MISREADS)
def find_exchanged(logs: MeasuredLogs) -> list[Finding]:
    """Return which joints are exchanged, turned, or in degrees."""
    robot, n = logs.robot, len(logs.joints)
    if robot.closed or robot.base is not None or n < 2:
        return []
    plain = _Change(tuple(range(n)), (1.0,) * n, tuple(range(n)), (1.0,) * n)
    stride = max(1, len(logs.torque) // ENOUGH_ROWS)
    some, torque = logs.motion[::stride], logs.torque[::stride]
    # Of positions as they stand, and of those that were asked for last.
    regressor = lru_cache(maxsize=2)(partial(_regressor, logs, some))
    given = _error(regressor, torque, plain)
    # Relative error of the unpruned model up to which nothing is looked for.
    if not given > 0.1:
        return []
    tried = [(_error(regressor, torque, c), c) for c in _candidates(logs, plain)]
    least, best = min(tried, key=lambda pair: pair[0])
    if least**2 >= RULES.mixed_error * given**2 or not best.says:
        return []
    return [Finding("exchanged", what=best.says, least=least, given=given)]


def _candidates(logs: MeasuredLogs, plain: _Change) -> Iterator[_Change]:
    """Yield what the columns might have been meant to be."""
    names, n = logs.joints, len(logs.joints)
    say, same = partial(phrase, "exchanged"), plain.order
    pairs = combinations(range(n), 2) if n <= MOST else pairwise(range(n))
    for i, j in pairs:
        order = list(same)
        order[i], order[j] = j, i
        swap, pair = tuple(order), f"{names[i]} and {names[j]}"
        yield replace(plain, order=swap, says=say("positions", pair=pair))
        yield replace(plain, order=swap, torques=swap, says=say("joints", pair=pair))
        yield replace(plain, torques=swap)
    for k, joint in enumerate(names):
        turned = tuple(-1.0 if i == k else 1.0 for i in range(n))
        yield replace(plain, factor=turned, says=say("sign", joint=joint))
        yield replace(plain, factor=turned, signs=turned, says=say("way", joint=joint))
        yield replace(plain, signs=turned)
        small = tuple(DEGREE if i == k else 1.0 for i in range(n))
        if not logs.robot.is_prismatic(int(logs.robot.actuated[k])):
            yield replace(plain, factor=small, says=say("angle", joint=joint))
    for shift in range(1, n):
        yield replace(plain, torques=same[shift:] + same[:shift])


def _regressor(
    logs: MeasuredLogs, some: Motion, order: tuple[int, ...], factor: tuple[float, ...]
) -> Array | None:
    """Return the regressor of other positions, None where no motion has them."""
    motion = some
    if order != tuple(range(len(order))) or set(factor) != {1.0}:
        given = some.actuated_q, some.actuated_v, some.actuated_a
        try:
            moved = [x[:, list(order)] * np.array(factor) for x in given]
            motion = complete_motion(logs.robot, some.t, *moved)
        except ClosureError:
            return None
    structure = logs.structure
    return structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept]


def _error(regressor: Callable[..., Array | None], tau: Array, change: _Change) -> float:
    """Return the relative error of the unpruned model with an offset a joint, joints alike."""
    tau = tau[:, list(change.torques)] * change.signs
    spread = tau.std(0)
    if not (spread > 0).all():
        return 0.0
    W = regressor(change.order, change.factor)
    return np.inf if W is None else unexplained(W / spread[:, None], tau / spread)


def unexplained(W: Array, tau: Array) -> float:
    """Return what a regressor (m, n, p) and offsets leave of torque (m, n), as a share."""
    m, n, p = W.shape
    if m * n < 2 * (p + n):
        return 0.0
    A = (W - W.mean(0)).reshape(m * n, p)
    b = (tau - tau.mean(0)).reshape(-1)
    length = np.linalg.norm(A, axis=0)
    A = A[:, length > 0] / length[length > 0]
    square, V = np.linalg.eigh(A.T @ A)
    kept = square > ROUNDOFF * square[-1]
    fit = (V[:, kept].T @ (A.T @ b)) / np.sqrt(square[kept])
    size, explained = float(b @ b), float(fit @ fit)
    return float(max(1.0 - explained / size, 0.0) ** 0.5)
