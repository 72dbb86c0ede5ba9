"""What is odd about torque: unit, sign, joint, side of a gear, weight, flat tops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from itertools import combinations

import numpy as np
from scipy.special import stdtrit

from identifiability.foundation.errors import ClosureError, listing
from identifiability.foundation.linalg import NEARLY, ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS, REACH, percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.commands import of_commands
from identifiability.logs.gaps import smallest_change
from identifiability.regression.mix_up import find_mix_up
from identifiability.robot import Motion, complete_motion
from identifiability.workflows.oddities.check import Does, MeasuredLogs, check, unexplained, without
from identifiability.workflows.oddities.rules import RULES

# At which joints the file's masses say what weight there is.


def feel_weight(logs: MeasuredLogs) -> tuple[Array, np.ndarray]:
    """Return the weight that each joint holds, and at which joints the file knows it, (n,) each.

    There it is no small share of that of like joints, and what it is does not hang on how wrong
    each mass is: of a gripper whose fingers hold each other up, or of an arm with counterweights,
    the file knows the difference of two weights as little as its sign.
    """
    size, units = np.sqrt(np.mean(logs.gravity**2, 0)), np.array(logs.robot.torque_units)
    most = np.array([size[units == u].max() for u in units])
    sure = size > REACH * logs.weight_error
    # Weight must be this share of the largest one among like joints.
    felt: np.ndarray = (size > 0.05 * most) & sure & logs.measured
    return size, felt


# An "effort" that is no force: it does not carry the weight that the robot file puts on it.


@check(
    "no force",
    Does.EXPLAINS,
    8,
    says="By the masses of the robot file, the torque does not carry the weight (…)",
    means="A joint has to hold weight, and its torque column does not show it.",
    do="Check what the column is. If a counterweight, spring or brake holds the load, say so "
    "(a spring in the model, `locked` joints); else leave the joint out.",
)
def find_weightless(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on joints whose torque does not carry the file's weight, or none."""
    if not logs.weighs:
        return ()
    weight, felt = feel_weight(logs)
    measured, units = np.sqrt(np.mean(logs.torque**2, 0)), logs.robot.torque_units
    # Measured torque is too small if its size is this share of the weight that it has to
    # hold.
    light = (measured < 0.1 * weight) & felt
    if not light.any():
        return ()
    said = [
        f"{logs.joints[k]} has to hold {weight[k]:.3g} {units[k]} and shows {measured[k]:.2g}"
        for k in np.flatnonzero(light)
    ]
    return (
        f"By the masses of the robot file, the torque does not carry the weight ({listing(said, 4)}"
        "): it may be no force at all (a current, a percentage, a command), in another unit, or a "
        "counterweight, spring or brake holds the load; check the column, else the masses found "
        "behind this joint are too small.",
    )


# How much of its weight the torque of each joint carries: none of it, half, all, or the opposite.
#
# Drivers that compensate gravity report what they add to it; torque before a gear is a fraction of
# it. At each joint the measured torque is regressed on the torque that holds the file's masses,
# beside what else they predict and what any drive adds.


#: The factor is the nearest of these, if its interval lies nearer to it than to any other and is
#: no wider than they lie apart.
FACTORS: tuple[Tolerance, Tolerance, Tolerance, Tolerance] = (-1.0, 0.0, 0.5, 1.0)

#: Samples on which models are compared.
ENOUGH = 300

#: Stretches by whose scatter an interval is found, and Student's quantile of as many.
STRETCHES = 20
QUANTILE = float(stdtrit(STRETCHES - 1, ENDS[1]))


@frozen
class Carried:
    """How much of the file's weight the torque of a joint carries.

    Attributes
    ----------
    joint : int
    factor, half : float
        With the half width of its 95 % interval.
    moving, moving_half : float
        The same of what the file's masses need to be moved; NaN where it does not show.
    """

    joint: int
    factor: float
    half: float
    moving: float = np.nan
    moving_half: float = np.nan

    @property
    def nearest(self) -> float:
        """The one of `FACTORS` that it is, NaN if it may be several, or bodies are not the file's.

        What moves the file's masses says whether they are there at all: a tool that the file does
        not state, or a spring, carries weight of its own.
        """
        others = abs(self.moving) - self.moving_half > RULES.unit_factor
        return np.nan if others else _nearest(self.factor, self.half)

    @property
    def moves(self) -> float:
        """The same of what moves the masses."""
        return _nearest(self.moving, self.moving_half)

    @property
    def is_half(self) -> bool:
        """Whether all of it is half of what the masses ask for, as far as it shows."""
        # No factor is named whose interval ends farther from it than this.
        near = abs(self.factor - 0.5) - self.half <= 0.05
        return near and self.nearest == 0.5 and (np.isnan(self.moves) or self.moves == 0.5)


def _nearest(value: float, half: float) -> float:
    if not half < RULES.factor_widest:
        return np.nan
    own = {min(FACTORS, key=lambda f: abs(f - x)) for x in (value - half, value + half)}
    return own.pop() if len(own) == 1 else np.nan


def measure_carried(logs: MeasuredLogs) -> list[Carried]:
    """Return how much of the file's weight each joint's torque carries, where it has some."""
    weight, found = logs.gravity, []
    for k in np.flatnonzero(feel_weight(logs)[1]):
        moving = logs.predicted[:, k] - weight[:, k]
        own = np.column_stack([weight[:, k], moving, logs.ordinary(int(k))])
        own, torque = own[logs.data[:, k]], logs.torque[logs.data[:, k], k]
        value, half = regress(own, torque)
        if not half[0] < RULES.factor_widest:  # weight that hardly varies is told from no offset
            value, half = regress(own[:, [0, 1, 3, 4, 5]], torque)
        if np.isfinite(half[0]):
            found.append(Carried(int(k), value[0], half[0], value[1], half[1]))
    return found


def regress(X: Array, y: Array) -> tuple[Array, Array]:
    """Return coefficients of y (N,) on columns (N, p), and half of their 95 % intervals.

    By the scatter of the scores over stretches, which holds what successive samples share; NaN
    where a column does not differ from the others.
    """
    length = np.linalg.norm(X, axis=0)
    used = length > 0
    A = X[:, used] / length[used]
    square, V = np.linalg.eigh(A.T @ A)
    good = square > ROUNDOFF * square[-1]
    inverse = (V[:, good] / square[good]) @ V[:, good].T
    value = inverse @ (A.T @ y)
    scores = A * (y - A @ value)[:, None]
    sums = np.stack([s.sum(0) for s in np.array_split(scores, STRETCHES)])
    spread = inverse @ (sums.T @ sums) @ inverse * STRETCHES / (STRETCHES - 1)
    lost = (V[:, ~good] ** 2).sum(1) > NEARLY
    half = np.where(lost, np.nan, QUANTILE * np.sqrt(np.diag(spread)))
    out, halves = np.full((2, len(length)), np.nan)
    out[used], halves[used] = value / length[used], half / length[used]
    return out, halves


@check(
    "another share of the weight",
    Does.MISREADS,
    5,
    says="By the masses of the robot file, …",
    means="The effort does not carry the robot's weight as it should: it lacks gravity, has the "
    "other sign, or is that of the motor before its gear.",
    do="The sentence has the line to write: `compensated = true`, `sign = -1`, or `side = "
    '"motor"` with `ratio`, under `[torque]` in the sidecar. Where the column is right, '
    "`gain = 1` there says so.",
)
def find_gravity(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque that does not carry the file's weight as it should, or none.

    What the sidecar says of torque goes before: `compensated`, `sign`, `gain` and `ratio`.
    """
    torque = logs.robot.torque
    if not logs.weighs or torque.compensated is not None:
        return ()
    carried = measure_carried(logs)
    none = [c for c in carried if c.nearest == 0.0 and c.moves != 0.0]
    # What the masses need to be moved shows that they are right; else the whole fit has to.
    proved = bool(none) and all(c.moves == 1.0 for c in none)
    if none and (proved or _lacks_weight(logs, [c.joint for c in none])):
        return (_tell_compensated(logs, none, len(none) == len(carried)),)
    opposite = [c for c in carried if c.nearest == -1.0]
    if opposite and not torque.sign:
        return (
            f"By the masses of the robot file, {_listed(logs, opposite)}: the torque pulls "
            "the wrong way. Its sign, the direction or zero of a joint, or gravity (a robot that "
            "hangs from the ceiling) is another one: correct it ([torque] sign = -1 in the "
            "sidecar, or gravity in the file; sign = 1 says that the torque is right).",
        )
    half = [c for c in carried if c.is_half]
    told = [c for c in carried if np.isfinite(c.nearest)]
    sure = len(half) == len(told) > 1 or any(_gear(logs, c.joint) != 1.0 for c in half)
    if half and sure and not (torque.gain or torque.ratio):
        return (
            f"By the masses of the robot file, {_listed(logs, half)}, and the torque that "
            'moves them no more: it looks like torque before a gear of 2 (side = "motor" under '
            f"[torque] in the sidecar, with its ratio{_tell_gears(logs, half)}), or the file's "
            "masses are twice too large (gain = 1 there says so).",
        )
    return ()


def _lacks_weight(logs: MeasuredLogs, joints: list[int]) -> bool:
    """Whether the unpruned model fits as well where some joints carry no weight, whatever it is."""
    stride = max(1, len(logs.torque) // ENOUGH)
    motion, tau = logs.motion[::stride], logs.torque[::stride]
    structure, spread = logs.structure, tau.std(0)
    if not (spread > 0).all():
        return False
    model, kept = structure.model, structure.base.kept
    weightless = structure.robot.model.copy()
    weightless.gravity.linear = np.zeros(3)
    light = replace(structure.robot, model=weightless)
    W = model.regressor(structure.robot, motion)
    bare = W.copy()
    # A tilt of the base is no parameter of what has no weight.
    there = np.isin(structure.columns, [p.name for p in model.parameters(light)])
    bare[:, joints] = 0.0
    at = np.ix_(np.arange(len(bare)), np.asarray(joints), np.flatnonzero(there))
    bare[at] = model.regressor(light, motion)[:, joints]
    W, bare = W[:, :, kept], bare[:, :, kept]
    given, lighter = (unexplained(x / spread[:, None], tau / spread) for x in (W, bare))
    # How much worse one of two models may fit that is as good.
    return lighter <= 1.1 * given


def _tell_compensated(logs: MeasuredLogs, none: list[Carried], every: bool) -> str:
    names = ", ".join(f'"{logs.joints[c.joint]}"' for c in none)
    return (
        f"By the masses of the robot file, {_listed(logs, none)}, although it moves them: the "
        "effort is compensated for gravity, as some drivers report it, and no mass that is found "
        f"stands. Say compensated = {'true' if every else f'[{names}]'} under [torque] in the "
        "sidecar, and what holds the file's weight is added again; false, where a spring or a "
        "counterweight that the file does not state holds it."
    )


def _listed(logs: MeasuredLogs, those: list[Carried]) -> str:
    said = [f"{logs.joints[c.joint]} {c.factor:.2f} ± {c.half:.2f}" for c in those]
    return f"the torque carries another share of the weight than all of it ({listing(said, 6)})"


def _gear(logs: MeasuredLogs, joint: int) -> float:
    """Return the gear that an MJCF states of a joint; 1 for none."""
    entry = logs.robot.entries.get("actuator_force", {}).get(logs.joints[joint])
    return abs(entry.factor) if entry else 1.0


def _tell_gears(logs: MeasuredLogs, half: list[Carried]) -> str:
    gears = [g for c in half if (g := _gear(logs, c.joint)) != 1.0]
    return f"; the file states a gear of {gears[0]:g}" if gears else ""


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
    Does.MISREADS,
    6,
    says="The measured torque … what the masses of the robot file ask for, …",
    means="The torque column is a current, a percentage, before the gear, or in another unit; "
    "or the file's masses are guesses.",
    do="State what one unit gives at the joint: `[torque] gain = {elbow = 110}` (torque "
    "constant × ratio), or find it from a weighed load (`identifiability payload --mass`).",
)
def find_torque_scale(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque whose size contradicts the file's masses, or none.

    Where it does at some joints alone, and bodies of other masses explain it as well as another
    gain there does, these are what the logs say (`find_other_masses`).
    """
    if not logs.weighs:
        return ()
    factors, known, odd = _odd_factors(logs)
    if odd.any() and odd.sum() < known.sum() and not _gain_explains(logs, odd, factors):
        return ()
    if not odd.any():
        some = factors[known]
        # Factors of two joints do not differ by more than this.
        if len(some) < 2 or some.max() < 8.0 * some.min():
            return ()
        odd = known
    joints, share = logs.joints, factors[odd]
    middle = float(np.exp(np.median(np.log(share))))
    # Factors of all joints are one unit if they lie within this factor of their middle.
    alike = bool((np.abs(np.log(share / middle)) < np.log(1.5)).all())
    sizes = _multiple(share)
    if odd.sum() == known.sum() and known.sum() > 1:
        if alike:
            return (
                f"The measured torque is {sizes} what the masses of the robot file ask for, at "
                f"all joints alike{_name_unit(middle)}: check its unit (N·m or N) and the file's "
                "masses; a factor by joint can be stated in the sidecar ([torque]).",
            )
        return (
            f"The measured torque is {sizes} what the masses of the robot file ask for, by another "
            "factor at each joint: it looks like motor currents, percent, or torque before the "
            f"gears; {REMEDY}",
        )
    which = listing([joints[k] for k in np.flatnonzero(odd)], 6)
    return (
        f"The measured torque of {which} is {sizes} what the masses of the robot file ask for, "
        f"{'not so at the other joints' if known.sum() > odd.sum() else 'the only one that shows'}"
        ": check unit and gain of the column (current, percent, before the gear?), or the file's "
        "masses.",
    )


@check(
    "other masses",
    Does.EXPLAINS,
    7,
    says="The measured torque of … what the masses of the robot file ask for, and bodies of "
    "other masses explain it better …",
    means="The robot carries something that its file does not state, and the column is right.",
    do="Put the tool or load into the robot file. Values are fitted to what moved all the same.",
)
def find_other_masses(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on joints that carry bodies of quite other masses than the file's."""
    if not logs.weighs:
        return ()
    factors, known, odd = _odd_factors(logs)
    if not odd.any() or odd.sum() == known.sum() or _gain_explains(logs, odd, factors):
        return ()
    which = listing([logs.joints[k] for k in np.flatnonzero(odd)], 6)
    return (
        f"The measured torque of {which} is {_multiple(factors[odd])} what the masses of the robot "
        "file ask for, and bodies of other masses explain it better than another gain of the "
        "column: state what the robot carries (a tool, a load) in the file.",
    )


def _odd_factors(logs: MeasuredLogs) -> tuple[Array, np.ndarray, np.ndarray]:
    """Return the factors of joints, which are known, and which are those of another unit."""
    factors = measure_factors(logs)
    known = np.isfinite(factors)
    return factors, known, known & (np.abs(np.log(factors)) > np.log(RULES.unit_factor))


def _gain_explains(logs: MeasuredLogs, odd: np.ndarray, factors: Array) -> bool:
    """Return whether the unpruned model fits better if torque at odd joints had another gain."""
    spread = logs.torque.std(0)
    if not (spread > 0).all():
        return True
    structure, data = logs.structure, logs.data
    W = structure.model.regressor(structure.robot, logs.motion)[:, :, structure.base.kept]
    W, tau = W * data[:, :, None], logs.torque * data
    gain = np.where(odd, factors, 1.0)
    given, other = (
        unexplained(W * g[:, None] / spread[:, None], tau / spread)
        for g in (np.ones(len(gain)), gain)
    )
    return other < given


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
# in degrees. What `regression.mix_up` finds in the torque columns alone is left to it.


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
    do="Look at the joint that is named; `--map OLD=NEW` exchanges columns, `--angles deg` "
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
    advice = "The angles seem to be degrees (--angles deg)"
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


# Torque columns that are exchanged or have the wrong sign (`regression.mix_up`).


@check(
    "exchanged or turned torque",
    Does.MISREADS,
    3,
    says="The torque columns seem to be exchanged: …",
    means="Two torque columns are exchanged, or one has the other sign: friction or rotor "
    "inertia would come out negative.",
    do="`--map OLD=NEW` for columns, `[torque] sign = -1` in the sidecar for a sign.",
)
def find_turned_torque(logs: MeasuredLogs) -> tuple[str, ...]:
    """Return one sentence on torque columns that are mixed up, or none."""
    structure = logs.structure
    if logs.robot.base is not None:  # whose rows are no columns, but combinations of them
        return ()
    regression = structure.regression(logs.samples)
    return tuple(filter(None, [find_mix_up(regression, structure.base.nonnegative)]))
