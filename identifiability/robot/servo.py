"""`Servo`: position servos of the actuated joints, which compute torque from commands.

    τ = clip(kp e + ki ∫e dt + kv (dq_cmd − dq) + τ_ff, low, high),  e = q_cmd(t − d) − q

An MJCF states them as ``<position>``, ``<velocity>`` or ``<general>`` with an affine bias. A
sidecar states them in ``[servo]``, which overrides the MJCF.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array, ArrayByName, NumberByName, Strings
from identifiability.foundation.rounding import REACH, format_number, measured
from identifiability.foundation.values import frozen

from .sidecar import ServoEntry, by_name

#: Source of gains that a robot file does not state.
SIDECAR = "the sidecar"

#: Source of gains that logs determined.
FOUND = "the logs"

#: Word of a sidecar for a gain to fit.
FIT = "fit"

#: Start of the name of an actuator of dry friction that builds up over a distance.
DRY_FRICTION = "dry friction of "


@frozen
class Servo:
    """The servos of the actuated joints, in the robot's order.

    Attributes
    ----------
    kp : (n,) [N·m/rad or N/m]
    kv : (n,) [N·m·s/rad or N·s/m]
        Both are NaN if they are to be fitted.
    low, high : (n,) [N·m or N]
        Limits at which their torque saturates.
    delay : float or None [s]
        Time from the log entry of a command until it acts; None if it is to be fitted.
    source : str
        Source of the gains, in words.
    rate : float [Hz]
        Rate of their measurements. A measurement acts until the next one, so its mean age is half a
        period.
    assumed : bool
        Whether that rate is assumed, not stated.
    lag, speed_lag : float or None [s]
        Further age of all measurements, as of a current loop, and of speeds alone, as of a filter;
        None if nobody states it. It then counts as zero, with a doubt.
    found : str
        How logs determined the gains, and the source of their scale.
    rolled : Rollouts or None
        The rollouts that determined them.
    play : (n,) [rad or m]
        Play between the measured motors and their loads; empty for none.
    slide : (n,) [rad or m]
        Distance over which dry friction builds up; empty for none.
    ki : (n,) [N·m/(rad·s) or N/(m·s)]
        Integral gains; NaN if they are to be fitted, and empty for none.
    doubt : (g, 3 n)
        Changes of ki, kv and log kp for each of g independent errors of one standard deviation.
    kept : bool
        Whether the scale of the gains holds, as that of other logs with which these are compared.
    """

    kp: Array
    kv: Array
    low: Array
    high: Array
    delay: float | None = None
    source: str = ""
    rate: float = 1000.0
    assumed: bool = True
    lag: float | None = None
    speed_lag: float | None = None
    found: str = ""
    rolled: Any = None
    play: Array = np.zeros(0)
    slide: Array = np.zeros(0)
    ki: Array = np.zeros(0)
    doubt: Array = np.zeros((0, 0))
    kept: bool = False

    @property
    def gain(self) -> Array:
        """Torque that one unit of the target makes, (n,): of a position, a speed, or a torque."""
        otherwise = np.where(self.kv == 0, 1.0, self.kv)
        return np.where(self.kp == 0, otherwise, self.kp)

    def by_gain(self, gain: Array) -> dict[str, Array]:
        """Return ``kp`` and ``kv`` with other gains of the target, (n,): kv where kp is zero."""
        follows_speed = self.kp == 0
        return {
            "kp": np.where(follows_speed, 0.0, gain),
            "kv": np.where(follows_speed, gain, self.kv),
        }

    @property
    def unknown(self) -> Array:
        """Return a mask of joints whose gains are to be fitted, (n,) bool."""
        return np.isnan(self.kp) | np.isnan(self.kv) | np.isnan(self.integral)

    @property
    def integral(self) -> Array:
        """Integral gain of each joint, (n,): zero for none."""
        return self.ki if self.ki.size else np.zeros(len(self.kp))

    @property
    def distance(self) -> Array:
        """Distance over which dry friction of each joint builds up, (n,): zero for none."""
        return self.slide if self.slide.size else np.zeros(len(self.kp))

    def having(self, gains: ArrayByName) -> Servo:
        """Return the servos with other ``kp``, ``kv`` and ``ki``, each (n,), if given.

        A ``limit`` above zero also limits the torque, unless its limits are already lower.
        """
        most = gains.get("limit", np.zeros(len(self.kp)))
        most = np.where(most > 0, most, np.inf)
        low = np.maximum(self.low, -most)
        high = np.minimum(self.high, most)
        own = {kind: gains.get(kind, getattr(self, kind)) for kind in ("kp", "kv", "ki")}
        return replace(self, **own, low=low, high=high)

    def divided(self, factor: Array | float) -> Servo:
        """Return the servos with all gains divided by a factor, or by one of each joint (n,)."""
        gains = {"kp": self.kp, "kv": self.kv, "ki": self.integral}
        return self.having({kind: gain / factor for kind, gain in gains.items()})

    def by_joint(self, joints: Sequence[str]) -> dict[str, dict[str, float]]:
        """Return gains and, if it is equal in both directions, ``limit`` by joint."""
        alike = np.where(self.high == -self.low, self.high, np.inf)
        some = self.integral if self.integral.any() else np.full(len(joints), np.inf)
        gains = {"kp": self.kp, "kv": self.kv, "ki": some, "limit": alike}.items()
        return {
            k: {j: v for j, v in zip(joints, each.tolist(), strict=True) if np.isfinite(v)}
            for k, each in gains
            if np.isfinite(each).any()
        }

    def slides(self, joints: Sequence[str]) -> dict[str, float]:
        """Return the distance over which dry friction builds up, by joint if there is any."""
        return {j: x for j, x in zip(joints, self.distance.tolist(), strict=True) if x}

    @property
    def age(self) -> float:
        """Return the mean age of a measurement while the servo uses it [s]."""
        return 0.5 / self.rate + (self.lag or 0.0)

    @property
    def speed_age(self) -> float:
        """Return the mean age of a speed while the servo uses it [s]."""
        return self.age + (self.speed_lag or 0.0)

    @property
    def damping(self) -> Array:
        """Return the effective damping, (n,): delayed positions reduce it."""
        return self.kv - self.kp * self.age

    @property
    def lead(self) -> Array:
        """Return the apparent inertia of the joint, (n,), from delayed speeds and positions."""
        return -self.kv * self.speed_age + 0.5 * self.kp * self.age**2

    @property
    def unknown_lags(self) -> tuple[float, float]:
        """Return standard deviations of `lag` and `speed_lag` [s]; zero for a known one.

        A current loop takes about half a period, and a difference of positions with a filter about
        one period. A servo of an assumed rate may measure half as often.
        """
        period = 1.0 / self.rate
        lag = 0.5 * period * (self.assumed + (self.lag is None))
        return lag, (1.0 + self.assumed) * period * (self.speed_lag is None)

    def state_lags(self) -> str:
        """Return a sentence on the effect of unknown lags on rotors and damping; else empty."""
        if not any(self.unknown_lags):
            return ""
        damping, rotor = (1e-3 * float(np.max(x)) for x in (self.kp, self.kv))
        return (
            "Nobody states how late the servos use their measurements: positions are taken as "
            f"{1e3 * self.age:.2g} ms old and speeds as {1e3 * self.speed_age:.2g} ms. A "
            f"millisecond more makes damping (Fv) up to {damping:.2g} and rotors (Ia) up to "
            f"{rotor:.2g} larger. Intervals allow for it, and rollouts hardly change. Where Fv or "
            "Ia matters, state rate (Hz), lag (s) and speed_lag (s) in [servo] of the sidecar."
        )

    def reaches_limit(self, torque: Array) -> np.ndarray:
        """Return where torque, (N, …, n), is at a limit in some row, (…, n) bool."""
        return np.any((torque <= self.low) | (torque >= self.high), axis=0)

    @property
    def doubted(self) -> tuple[Servo, ...]:
        """Return variants of the servos, each with one uncertain property off by one σ.

        Gains that logs determined are off by `doubt`, and lags that nobody states by their size.
        """
        each = [np.split(doubt, 3) for doubt in self.doubt]
        gains = [
            replace(self, ki=self.integral + ki, kv=self.kv + kv, kp=self.kp * (1 + share))
            for ki, kv, share in each
        ]
        lag, speed_lag = self.unknown_lags
        older = [replace(self, lag=(self.lag or 0.0) + lag)] if lag else []
        slower = [replace(self, speed_lag=speed_lag)] if speed_lag else []
        return (*gains, *older, *slower)


def weaken_servos(robot: Any, values: NumberByName) -> tuple[Any, dict[str, float]]:
    """Return a robot whose servos are as weak as scales of their torque say, and other values.

    A torque that was computed of commands is too large by a scale because the gains are.
    """
    scales = [f"{j}.scale" for j in robot.joints]
    if robot.servo is None or values.keys().isdisjoint(scales):
        return robot, {**values}
    factor = np.array([1.0 + values.get(name, 0.0) for name in scales])
    weak = replace(robot, servo=robot.servo.divided(factor))
    return weak, {n: x for n, x in values.items() if n not in scales}


def state_gain(value: float, sd: float) -> str:
    """Return a gain with its error (95 %), or with the note that it is not determined."""
    half = REACH * sd
    return measured(value, half) if half < value else f"{format_number(value, 2)} (not determined)"


def list_gains(told: Mapping[str, tuple[float, float]], joint: str) -> list[str]:
    """Return the gains of a joint that logs determine, each with its error (95 %).

    Parameters
    ----------
    told : mapping of str to (float, float)
        Gains by joint and kind, with their standard deviations.
    joint : str
    """
    pairs = {kind: told.get(f"{joint}.{kind}", (0.0, 0.0)) for kind in ("kp", "kv", "ki")}
    return [f"{kind} {state_gain(*pair)}" for kind, pair in pairs.items() if pair[0] > 0]


def state_delay(delays: Array, logs: Sequence[str] = ()) -> str:
    """Return the delays [s] of commands in logs as a clause of a sentence.

    A delay is negative if a command acts before the row that holds it.
    """
    late = 1e3 * np.asarray(delays)
    side = "before" if (late < 0).all() else "after"
    told = [f"{abs(x) if side == 'before' else x:.2g} ms" for x in late]
    if len({*told}) > 1 and logs:
        told = [f"{x} ({name})" for x, name in zip(told, logs, strict=True)]
    return f"commands act {listing(dict.fromkeys(told), 4)} {side} their rows"


def read_servo(
    path: Path, entry: ServoEntry | None, stated: ArrayByName, joints: Strings
) -> Servo | None:
    """Return the servos of sidecar and robot file; None if they state none.

    Parameters
    ----------
    path : Path
        The robot file, for sentences.
    entry : ServoEntry or None
        The sidecar's ``[servo]``. Gains are fitted if it states ``"fit"``, and at joints for which
        neither it nor the file states any.
    stated : mapping
        Values of the robot file by joint: kp, kv, ki, least and largest torque, and the distance
        over which dry friction builds up, (6,).
    joints : tuple of str
        The actuated ones.

    Raises
    ------
    RobotError
        If gains of a joint are zero, or a name is no actuated joint.
    """
    if entry is None and not all(j in stated for j in joints):
        return None
    entry = entry or ServoEntry()
    none = (np.nan, np.nan, 0.0, -np.inf, np.inf, 0.0)
    found = np.array([stated.get(joint, none) for joint in joints], float)
    for k, key in enumerate(("kp", "kv", "ki", "limit")):
        said = getattr(entry, key)
        table = said if isinstance(said, dict) else {} if said is None else {"*": said}
        for joint, x in by_name(path, f"servo.{key}", table, joints).items():
            own = found[joints.index(joint)]
            value = np.nan if x == FIT else float(x)
            own[k : k + 2] = (-value, value) if key == "limit" else (value, own[k + 1])
            if key == "kp" and np.isnan(own[1]) and x != FIT:
                own[1] = 0.0  # none stated is none
    kp, kv, ki, low, high, slide = found.T
    idle = ~(np.isnan(kp) | np.isnan(kv) | (kp > 0) | (kv > 0))
    if idle.any():
        loose = joints[int(np.argmax(idle))]
        raise RobotError(
            f"The servo of '{loose}' in {path} has neither kp nor kv, so its command says nothing "
            "of torque; give its gains in the sidecar: [servo] kp = …, kv = …."
        )
    stated_here = entry.kp or entry.kv or entry.ki or entry.limit
    told = bool(stated_here or np.isnan(kp).any())
    delay = None if entry.delay == "auto" else float(entry.delay)
    return Servo(
        *(kp, kv, low, high),
        delay=delay,
        source=SIDECAR if told else "the robot file",
        rate=entry.rate or Servo.rate,
        assumed=entry.rate is None,
        lag=entry.lag,
        speed_lag=entry.speed_lag,
        slide=slide,
        ki=ki,
    )
