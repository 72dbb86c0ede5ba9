"""Find wrong columns: positions beyond limits, and derivatives that do not fit.

A change of unit or sign is refused. Other contradictory derivatives are left out (`quality.mends`).
"""

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array
from identifiability.foundation.quoting import toml_key
from identifiability.foundation.values import frozen
from identifiability.robot import Robot

from .log import Log, join_logs
from .rules import RULES
from .spikes import TURN

#: Units of length that people give instead of SI, and how many make one of SI.
_LENGTHS = {"mm": 1e3, "cm": 1e2}


def check_units(robot: Robot, windows: Sequence[Log]) -> None:
    """Refuse degrees given as radians and millimetres given as metres, if the data show it.

    Parameters
    ----------
    robot : Robot
    windows : sequence of Log
        Windows of one log, or one window with all of it.

    Raises
    ------
    LogError
    """
    log = windows[0]
    if robot.angles is None:
        _check_angles(robot, windows)
    for k, joint in enumerate(log.joints):
        if robot.is_prismatic(int(robot.actuated[k])):
            q = np.concatenate([w.q[:, k] for w in windows])
            low, high = robot.limits[k]
            fits = [u for u, f in _LENGTHS.items() if _fits(q, low, high, f)]
            if fits:
                raise LogError(
                    f"{log.name}: {_span(joint, q)}, which does not fit the joint's limits "
                    f"{low:.4g} … {high:.4g} m; it looks like {fits[0]}: convert it to m."
                )
    for c in contradictions(join_logs(windows)):
        if c.in_unit:
            raise LogError(
                f"{log.name}: '{c.joint}.{c.kind}' is {1 / c.slope:.4g} times the time derivative "
                f"of '{c.joint}.{c.of}'; one of them (or the time) is in another unit or has "
                "another sign: give all in SI units."
            )


def looks_like_degrees(q: Array, low: float, high: float) -> bool:
    """Return whether positions (N,) fit limits [rad] in degrees, and not in rad by whole turns."""
    median = float(np.median(q))
    middle = round((median - 0.5 * (low + high)) / (2 * np.pi)) * 2 * np.pi
    if not np.isfinite(middle) or np.mean((q - middle < low) | (q - middle > high)) < RULES.small:
        return False
    return _fits(q, low, high, 180 / np.pi)


def _fits(q: Array, low: float, high: float, factor: float) -> bool:
    """Return whether positions (N,) do not fit limits as they are, but divided by a factor do."""
    if not np.isfinite(high - low) or np.mean((q < low) | (q > high)) <= 0.5:
        return False
    return bool(np.mean((q >= low * factor) & (q <= high * factor)) > 1 - RULES.small)


def _check_angles(robot: Robot, windows: Sequence[Log]) -> None:
    """Refuse degrees if most revolute joints with limits show them.

    Under commands one joint of another unit is enough, because it moves all others in rollouts.
    """
    bounded = [
        k
        for k, dof in enumerate(robot.actuated)
        if not robot.is_prismatic(int(dof)) and np.isfinite(np.ptp(robot.limits[k]))
    ]
    columns = {k: np.concatenate([w.q[:, k] for w in windows]) for k in bounded}
    for is_odd, why in ((looks_like_degrees, _DEGREES), (_beyond, _TICKS)):
        odd = [k for k in bounded if is_odd(columns[k], *robot.limits[k])]
        is_enough = windows[0].commanded and is_odd is _beyond and bool(odd)
        most = 2 * len(odd) > len(bounded)
        if is_enough or most:
            joint = windows[0].joints[odd[0]]
            low, high = robot.limits[odd[0]]
            stated = '"*"' if most else toml_key(joint)
            shares = ""
            if windows[0].commanded and is_odd is looks_like_degrees:
                shares = _shares_of_range(joint, [*columns.values()], low, high)
            raise LogError(
                f"{windows[0].name}: {_span(joint, columns[odd[0]])}, and the joint's limits are "
                f"{low:.4g} … {high:.4g} rad: it {why} state the scale of ticks or normalised "
                f"units: [columns] {stated} = {{scale = …, offset = …}} in the sidecar "
                f"(rad = scale × value + offset).{_ticks_of_servos(columns[odd[0]])}{shares}"
            )


#: Explanations of positions beyond limits, and remedies.
_DEGREES = (
    'looks like degrees: say --set angles=deg (or angles = "deg" in the sidecar; a unit in the '
    "header goes before both: correct that), or --set angles=rad if they are rad, or"
)
_TICKS = "spans more than twice the joint's limits;"


def _shares_of_range(joint: str, columns: Sequence[Array], low: float, high: float) -> str:
    """Return how to state shares of a range if positions may be shares; else an empty text."""
    most = 100  # of LeRobot's normalised units
    if any(np.abs(q).max() > most for q in columns):
        return ""
    scale = (high - low) / (2 * most)
    return (
        f" Without a unit these may be LeRobot's normalised units: −{most} … {most} of each "
        f"joint's range, 0 … {most} of a gripper's. They look like degrees, so check how they were "
        f"recorded. If −{most} and {most} are limits of the robot file, write {toml_key(joint)} = "
        f"{{scale = {scale:.6g}, offset = {0.5 * (low + high):.6g}}}, and so for each joint."
    )


def _ticks_of_servos(q: Array) -> str:
    """Return the scale of common servos if positions (N,) are their ticks; else an empty text."""
    ticks = 2**12  # in a turn of Feetech STS and Dynamixel X servos, by their manuals
    if np.any(q != np.rint(q)) or q.min() < 0 or q.max() >= ticks:
        return ""
    scale = TURN / ticks
    return (
        f" For servos with {ticks} ticks a turn and zero in the middle, "
        f"write scale = {scale:.6g}, offset = {-0.5 * TURN:.6g}."
    )


def _beyond(q: Array, low: float, high: float) -> bool:
    """Return whether positions (N,) span more than limits and two turns do, wherever zero is."""
    return float(np.ptp(q)) > 2 * max(high - low, TURN)


def _span(joint: str, q: Array) -> str:
    return f"'{joint}.q' spans {q.min():.4g} … {q.max():.4g}"


@frozen
class Contradiction:
    """A measured derivative that does not fit its integral.

    Attributes
    ----------
    joint, kind, of : str
        The joint, the channel, and the channel that it should be the derivative of.
    explained : float
        Share of the variance of channel `of` that the integral explains.
    slope : float
        Factor of the integral in this fit.
    lag : float
        Time by which it lags the true derivative [s]; 0 if that is not the contradiction.
    movable : bool
        Whether the column, moved by the lag, is better than a derivative of the samples.
    """

    joint: str
    kind: str
    of: str
    explained: float
    slope: float
    lag: float = 0.0
    movable: bool = False

    @property
    def text(self) -> str:
        """The explained share in half a sentence."""
        explained = 100 * max(self.explained, 0.0)
        return phrase(
            "contradictions",
            "one",
            explained=explained,
            joint=self.joint,
            kind=self.kind,
            of=self.of,
            slope=self.slope,
        )

    @property
    def in_unit(self) -> bool:
        """Return whether it is the derivative in another unit or with another sign."""
        return self.explained > 1 - RULES.unexplained and not 0.5 < self.slope < 2


def contradictions(log: Log) -> list[Contradiction]:
    """Return the measured derivatives that do not fit their channel.

    They may belong to another joint or to the desired motion, or be delayed or filtered too much.
    The comparison integrates the derivative, because differentiation would amplify noise.
    """
    found = []
    least = 1 - RULES.unexplained
    for kind, of in (("dq", "q"), ("ddq", "dq")):
        rate = getattr(log, kind)
        x = getattr(log, of)
        if rate is None or x is None:
            continue
        for k, joint in enumerate(log.joints):
            fit = _compare(log.t, x[:, k], rate[:, k])
            if fit is None:
                continue
            slope, unexplained, lag, movable = fit
            if unexplained > RULES.unexplained or not least < slope < 1 / least:
                found.append(Contradiction(joint, kind, of, 1 - unexplained, slope))
            elif lag:
                found.append(Contradiction(joint, kind, of, 1 - unexplained, slope, lag, movable))
    return found


def _compare(t: Array, x: Array, rate: Array) -> tuple[float, float, float, bool] | None:
    """Return the best factor of the integral of a rate (N,), its unexplained variance, its lag.

    The variance is relative to that of `x`, and a lag that does not matter is 0. The last value is
    whether the rate can be moved by its lag. The result is None if noise hides the motion.
    """
    dt = np.diff(t)
    whole = dt < RULES.gap * np.median(dt)
    given = np.cumsum(np.where(whole, np.diff(x), 0.0))
    mean = 0.5 * (rate[1:] + rate[:-1])
    integral = np.cumsum(np.where(whole, mean * dt, 0.0))
    # An offset of the rate is a drift of its integral, which has no information on its shape.
    drift = np.column_stack([np.ones(len(dt)), t[1:] - t[0]])
    Q = np.linalg.qr(drift)[0]
    given = given - Q @ (Q.T @ given)
    integral = integral - Q @ (Q.T @ integral)
    noise = _find_noise(x)
    size = float(np.sqrt(np.mean(given**2)))
    # Least ratio of motion to the noise of single samples for a comparison.
    if not size > 4.0 * noise or not size > 0:
        return None
    square = float(integral @ integral)
    slope = float(given @ integral) / square if square > 0 else 0.0
    left = given - slope * integral
    steady = rate[1:] - Q @ (Q.T @ rate[1:])
    lag, movable = _find_lag(left, steady, float(np.median(dt)), noise)
    return slope, float(left @ left) / float(given @ given), lag, movable


def _find_noise(x: Array) -> float:
    """Return the noise of single samples of a channel (N,), from its second differences."""
    bends = np.diff(x, 2)
    return float(np.sqrt(np.mean(bends**2) / 6)) if len(x) > 2 else 0.0


def _find_lag(left: Array, rate: Array, step: float, noise: float) -> tuple[float, bool]:
    """Return the lag of a rate (N,) [s] that its integral leaves unexplained; 0 if it is harmless.

    An integral that lags by d misses d times the rate. A lag counts if it is certainly longer than
    that of a backward difference, half a step, and moving the rate or a derivative of the samples
    is better. A low-pass or a delay spoils a moved rate by a term of second order, and noise spoils
    a derivative. The second value says whether the moved rate is the best of the three.
    """
    square = float(rate @ rate)
    if not square > 0:
        return 0.0, False
    lag = float(left @ rate) / square
    misses = (left - lag * rate) * rate
    # Few long blocks, as errors of an integral last; errors of one sign are the worst case.
    blocks = np.array_split(misses, round(len(rate) ** (1 / 3)))
    error = sum(abs(float(block.sum())) for block in blocks) / square
    if not abs(lag) > 0.5 * step + error:
        return 0.0, False
    samples = max(round(abs(lag) / step), 1)
    changes = rate[samples:] - rate[:-samples]
    variance = _find_noise(rate) ** 2
    spoilt = np.mean(changes**2) - 2 * variance
    # A derivative up to the cut-off f has the variance ∫ (2πf)² 2 step df of white noise.
    cutoff = RULES.cutoff_highest / step
    derived = noise * 2 * np.pi * cutoff * np.sqrt(2 * cutoff * step / 3)
    bends = changes[samples:] - changes[:-samples]
    distorted = (np.mean(bends**2) - 6 * variance) / 4
    if not spoilt > min(distorted, derived**2):
        return 0.0, False
    return lag, bool(distorted < derived**2)
