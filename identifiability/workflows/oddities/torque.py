"""What is odd about torque: unit, sign, joint, side of a gear, weight, flat tops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from itertools import combinations

import numpy as np

from identifiability.foundation.errors import ClosureError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.commands import of_commands
from identifiability.logs.gaps import smallest_change
from identifiability.robot import Motion, complete_motion
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check, unexplained, without
from identifiability.workflows.oddities.rules import RULES

# Torque in another unit, or before a gear: its size beside what the robot file's masses ask for.
#
# At each joint the measured torque is regressed on what the file's masses predict, beside what any
# drive adds (friction, rotor inertia, offset); or on all that the file predicts, where it states
# the drive too. A file can be wrong, but hardly by a factor of `unit_factor`.


#: What is to be done about gains.
REMEDY = (
    "state the gain of each joint in the sidecar ([torque]), or correct the masses of the file."
)


#: Units of torque that people give, and how many of them make one N·m or N.
UNITS = {"mN·m (or mN)": 1e3, "N·cm": 1e2, "N·mm": 1e3, "kN·m (or kN)": 1e-3}


@check(
    "torque in another unit",
    Does.EXPLAINS,
    6,
    says="The measured torque … what the masses of the robot file ask for, …",
    means="The torque column is a current, a percentage, before the gear, or in another unit; "
    "or the file's masses are guesses.",
    do="State what one unit gives at the joint: `[torque] gain = {elbow = 110}` (torque "
    "constant × ratio), or find it from a weighed load (`identifiability payload --mass`).",
)
def find_torque_scale(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque of all joints whose size contradicts the file, or none.

    What one joint alone contradicts is another model (`alternatives`), or bodies of other masses.
    """
    if not logs.weighs:
        return ()
    factors = measure_factors(logs)
    share = factors[np.isfinite(factors)]
    odd = np.abs(np.log(share)) > np.log(RULES.unit_factor)
    # Factors of two joints do not differ by more than this.
    apart = not odd.any() and len(share) > 1 and share.max() >= 8.0 * share.min()
    if not len(share) or not (odd.all() or apart):
        return ()
    middle = float(np.exp(np.median(np.log(share))))
    # Factors of all joints are one unit if they lie within this factor of their middle.
    if (np.abs(np.log(share / middle)) < np.log(1.5)).all():
        return (
            f"The measured torque is {_multiple(share)} what the masses of the robot file ask for, "
            f"at all joints alike{_name_unit(middle)}: check its unit (N·m or N) and the file's "
            "masses; a factor by joint can be stated in the sidecar ([torque]).",
        )
    return (
        f"The measured torque is {_multiple(share)} what the masses of the robot file ask for, by "
        "another factor at each joint: it looks like motor currents, percent, or torque before the "
        f"gears; {REMEDY}",
    )


def measure_factors(logs: MeasuredLogs) -> Array:
    """Return measured over predicted torque of each joint, (n,); NaN where it does not show."""
    factors = np.full(len(logs.joints), np.nan)
    size = np.sqrt(np.mean(logs.predicted**2, 0))
    units = np.array(logs.robot.torque_units)
    for k in range(len(factors)):
        # Predicted torque of a joint must be this share of the largest one among like
        # joints.
        if size[k] < 0.02 * size[units == units[k]].max() or size[k] == 0:
            continue
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


def _multiple(factors: Array) -> str:
    low, high = (f"{x:.2g}" for x in (factors.min(), factors.max()))
    return f"{low} times" if low == high else f"{low} … {high} times"


def _name_unit(factor: float) -> str:
    names = [u for u, f in UNITS.items() if 1 / 2 < factor / f < 2]
    return f", as if it were in {' or '.join(names)}" if names else ""


# Torque that stops at an extreme value: what a drive was asked for beyond it is not in the log.


#: An extreme value is a flat top if the column stays there so long once [samples].
RUN = 4

#: Width of the bands, of the column's range.
BAND: Tolerance = 0.01


@check(
    "at a limit",
    Does.HINTS,
    23,
    says="Torque stops at an extreme value (…)",
    means="A drive or sensor saturated: what the torque would have been is not in the log.",
    do="Leave these stretches out, or move less fast; `limit` in `[servo]` states it for "
    "commanded robots, whose saturated samples have no weight.",
)
def find_saturation(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque columns with flat tops, or none."""
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
    if not found:
        return ()
    said = [
        f"'{joint}.tau' stays at {value:.4g} in {percent(share, 2)} of the samples"
        for joint, (share, value) in found.items()
    ]
    return (
        f"Torque stops at an extreme value ({listing(said, 4)}): a drive or sensor at its limit; "
        "what it should have been is not in the log, so leave these stretches out or move less "
        "fast.",
    )


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


@check(
    "exchanged joints, degrees",
    Does.MISREADS,
    2,
    says="…: read so, the unpruned model would err by … instead of ….",
    means="Joints, signs or units of columns are other ones than the robot file's: read "
    "otherwise, the same log makes sense.",
    do="Look at the joint that is named; `--map OLD=NEW` exchanges columns, `--set angles=deg` "
    "reads degrees, and a sign is turned in the log or in the file.",
)
def find_exchanged(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on joints that are exchanged, turned, or in degrees, or none."""
    robot, n = logs.robot, len(logs.joints)
    if robot.closed or robot.base is not None or n < 2:
        return ()
    plain = _Change(tuple(range(n)), (1.0,) * n, tuple(range(n)), (1.0,) * n)
    stride = max(1, len(logs.torque) // ENOUGH_ROWS)
    some, torque = logs.motion[::stride], logs.torque[::stride]
    # Of positions as they stand, and of those that were asked for last.
    regressor = lru_cache(maxsize=2)(partial(_regressor, logs, some))
    given = _error(regressor, torque, plain)
    # Relative error of the unpruned model up to which nothing is looked for.
    if not given > 0.1:
        return ()
    tried = [(_error(regressor, torque, c), c) for c in _candidates(logs, plain)]
    least, best = min(tried, key=lambda pair: pair[0])
    if least**2 >= RULES.mixed_error * given**2 or not best.says:
        return ()
    return (
        f"{best.says}: read so, the unpruned model would err by {percent(least, 2)} instead of "
        f"{percent(given, 2)}. Check which column is which, and its unit and direction.",
    )


def _candidates(logs: MeasuredLogs, plain: _Change) -> Iterator[_Change]:
    """Yield what the columns might have been meant to be."""
    names, n = logs.joints, len(logs.joints)
    same, one = plain.order, plain.factor
    near = n > MOST
    for i, j in combinations(range(n), 2):
        if near and j > i + 1:
            continue
        order = list(same)
        order[i], order[j] = j, i
        swap, pair = tuple(order), f"{names[i]} and {names[j]}"
        yield _Change(swap, one, same, one, f"The positions of {pair} seem to be exchanged")
        yield _Change(swap, one, swap, one, f"The joints {pair} seem to be exchanged")
        yield _Change(same, one, swap, one)
    for k in range(n):
        turned = tuple(-1.0 if i == k else 1.0 for i in range(n))
        small = tuple(DEGREE if i == k else 1.0 for i in range(n))
        who = names[k]
        yield _Change(
            same, turned, same, one, f"The positions of {who} seem to have the wrong sign"
        )
        yield _Change(same, turned, same, turned, f"The joint {who} seems to turn the other way")
        yield _Change(same, one, same, turned)
        if not logs.robot.is_prismatic(int(logs.robot.actuated[k])):
            yield _Change(same, small, same, one, f"The angles of {who} seem to be degrees")
    slides = [logs.robot.is_prismatic(int(k)) for k in logs.robot.actuated]
    angles = tuple(1.0 if s else DEGREE for s in slides)
    advice = "The angles seem to be degrees (--set angles=deg)"
    yield _Change(same, angles, same, one, advice)
    yield _Change(same, one, same[::-1], one)
    for shift in range(1, n):
        yield _Change(same, one, same[shift:] + same[:shift], one)


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
