"""`Commands`: what position servos are told so that a log of it says much, from rest to rest.

Multi-sines show inertia and gravity, chirps the bandwidth of servos and their delay, steps friction
and saturation, each for a third of the time. A simulation of the robot file says how the joints
follow; each signal of each joint is made smaller until position, speed and torque stay within their
limits there, so what is wrong in the file is wrong in that, too: begin with less (`scale`).
"""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd

from identifiability.foundation.engines import one_thread
from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import LimitShare, checked, within
from identifiability.foundation.output import check_ending, csv_text, write_bytes, write_text
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import acting
from identifiability.robot import Robot, RobotLike
from identifiability.simulation.motion import write_command_bag
from identifiability.simulation.rollout import NO_SERVO, CommandedRobot
from identifiability.workflows.excite.limits import (
    CLEARANCE,
    INNER,
    Clearance,
    Limits,
    LimitsLike,
    find_limits,
)

#: Share of its range that a joint swings at most.
SWING: Tolerance = 0.3

#: Band of the sines of each joint [Hz]; the chirp goes through the same.
BAND: tuple[Tolerance, Tolerance] = (0.1, 3.0)

#: How often signals are made smaller, and poses at which collisions are looked for.
TRIED, POSES = 30, 300


@frozen(kw_only=True)
class Commands:
    """Commands of position servos. Make them with `excite_commands`.

    Attributes
    ----------
    robot : Robot
    limits : Limits
    t : (N,) [s]
    targets : (N, n) [rad or m]
        What each servo is told; the first and last rows are at rest.
    shares : (n,)
        Most that each joint uses of its limits of position, speed and torque when it is moved so.
    unwatched : str
        Why collisions were not looked for; empty if they were.
    """

    robot: Robot
    limits: Limits
    t: Array
    targets: Array
    shares: Array
    unwatched: str

    def to_frame(self) -> pd.DataFrame:
        """Return ``t`` and of each joint ``.cmd`` [s; rad or m]."""
        columns = zip(self.robot.joints, self.targets.T, strict=True)
        return pd.DataFrame({"t": self.t, **{f"{j}.cmd": x for j, x in columns}})

    def write(self, path: str | Path) -> Path:
        """Write the commands as CSV, as NumPy arrays (.npz: t, cmd, joints) or as a bag (.mcap).

        The bag has a ``std_msgs/Float64MultiArray`` a row, in the robot's order of joints.

        Raises
        ------
        LogError, OutputError
        """
        path = Path(path)
        check_ending(path, ".csv", ".npz", ".mcap")
        if path.suffix.lower() == ".mcap":
            return write_command_bag(path, self.t, self.targets)
        if path.suffix.lower() == ".npz":
            packed = BytesIO()
            np.savez(packed, t=self.t, cmd=self.targets, joints=np.array(self.robot.joints))
            return write_bytes(path, packed.getvalue())
        return write_text(path, csv_text(self.to_frame()))

    @property
    def statement(self) -> str:
        """What they ask of the robot, in words."""
        k = int(np.argmax(self.shares))
        text = (
            f"Commands of {self.t[-1]:.3g} s from rest to rest (multi-sine, chirp, steps); moved "
            f"by them, the robot of the file uses at most {100 * self.shares[k]:.0f} % of its "
            f"limits ({self.robot.joints[k]})."
        )
        if self.limits.assumed:
            text += f" Assumed, as nobody stated them: {listing(self.limits.assumed)}."
        pairs = zip(self.robot.joints, self.targets[0], strict=True)
        rest = listing([f"{j} = {x:.4g}" for j, x in pairs], 12)
        return f"{text} They begin and end at {rest}. {self.unwatched}".strip()


@checked
def excite_commands(
    robot: RobotLike,
    *,
    duration: Annotated[float, within(3.0, 3600.0)] = 15.0,
    rate: Annotated[float, within(1.0, 10_000.0)] = 50.0,
    limits: LimitsLike | None = None,
    scale: LimitShare = 1.0,
    seed: int = 0,
) -> Commands:
    """Find commands of position servos within limits of position, speed and torque.

    Parameters
    ----------
    robot : Robot, path or shipped name
        With servos.
    duration : float [s]
    rate : float [Hz]
        At which commands are sent.
    limits : mapping, path or None
        As in `excite`.
    scale : float
        Share of what the limits allow, of commands.
    seed : int

    Raises
    ------
    RobotError
        If it has no servos, or no commands keep the limits.
    """
    robot = Robot.of(robot)
    robot.check_stands("designing commands")
    if robot.servo is None:
        raise RobotError(f"{robot.path} {NO_SERVO}")
    known = find_limits(robot, limits)
    rng = np.random.default_rng(seed)
    home = robot.actuated_positions(robot.home[None])[0]
    span = known.high - known.low
    middle = np.clip(home, known.low + SWING * span, known.high - SWING * span)
    t = np.arange(round(duration * rate) + 1) / rate
    signals, edge = _signals(t, len(home), rng), _eased(t, t[0], t[-1])
    sizes, scaled = np.full((3, len(home)), INNER * SWING) * span, scale == 1.0
    watched, why = Clearance.of(robot)
    machine = CommandedRobot(robot, {})
    with one_thread("blas"):
        for _ in range(TRIED):
            wanted = middle + np.einsum("stn,sn->tn", signals, sizes)
            targets = home + edge[:, None] * (wanted - home)
            positions, torque = _follow(machine, t, targets)
            worst = _shares(robot, known, t, positions, torque)
            least = 1.0 if watched is None else _gap(robot, watched, positions)
            if worst.max() <= INNER and least > 0 and not scaled:
                sizes, scaled = scale * sizes, True
                continue
            if worst.max() <= INNER and least > 0:
                return Commands(
                    robot=robot,
                    limits=known,
                    t=t,
                    targets=targets,
                    shares=worst.max(0),
                    unwatched=why,
                )
            thirds = np.array_split(worst, 3)
            over = np.array([part.max(0) for part in thirds]) / INNER
            sizes = sizes * np.clip(np.where(over > 1, 0.95 / over, 1.0), 0.5, 1.0)
            sizes = sizes * (1.0 if least > 0 else 0.8)
    k = int(np.argmax(worst.max(0)))
    raise RobotError(
        f"No commands keep the limits of {robot.path}: at rest already, or on the way from home, "
        f"'{robot.joints[k]}' uses {100 * worst.max():.0f} % of one of them; state limits that "
        "hold at home, or another home."
    )


def _signals(t: Array, n: int, rng: np.random.Generator) -> Array:
    """Return multi-sine, chirp and steps within ±1, each in its third of the time, (3, N, n)."""
    ends = np.linspace(t[0], t[-1], 4)
    out = np.zeros((3, len(t), n))
    for k in range(n):
        for f in np.exp(rng.uniform(np.log(BAND[0]), np.log(BAND[1]), 6)):
            out[0, :, k] += np.sin(2 * np.pi * (f * t + rng.uniform())) / np.sqrt(2 * 6)
        own = t - ends[1]
        rise = (BAND[1] - BAND[0]) / (ends[2] - ends[1])
        out[1, :, k] = np.sin(2 * np.pi * ((BAND[0] + 0.5 * rise * own) * own + rng.uniform()))
        # A step is held between .4 and 1.2 s.
        at = np.cumsum(rng.uniform(0.4, 1.2, int((ends[3] - ends[2]) / 0.4) + 2)) + ends[2]
        levels = rng.uniform(-1, 1, len(at) + 1)
        out[2, :, k] = levels[np.searchsorted(at, t, side="right")]
    for s in range(3):
        out[s] *= _eased(t, ends[s], ends[s + 1])[:, None]
    return np.clip(out, -1, 1)


def _eased(t: Array, first: float, last: float) -> Array:
    """Return a window (N,) that is 0 outside and rises and falls smoothly."""
    rise = np.clip(2 * (t - first), 0, 1) * np.clip(2 * (last - t), 0, 1)
    eased: Array = 0.5 - 0.5 * np.cos(np.pi * rise)
    return eased


def _follow(machine: CommandedRobot, t: Array, targets: Array) -> tuple[Array, Array]:
    """Return positions of the joints and torque of their servos along commands, (N, n) each."""
    still = np.tile(targets[0], (len(t), 1))
    log = Log.from_arrays(t, still, 0 * still, joints=list(machine.robot.joints), name="commands")
    log = replace(log, q_ref=targets)
    q = machine.roll(log)[0]
    dt = float(t[1] - t[0])
    servo = machine.servo
    dq = np.gradient(q, dt, axis=0)
    # A step acts at once, before the joint has moved.
    before = np.vstack([q[:1], q[:-1]])
    torque = (
        servo.gain * acting(log, servo, t + 0.5 * dt, 1e-6, 0.0) - servo.kp * before - servo.kv * dq
    )
    return q, torque


def _shares(robot: Robot, limits: Limits, t: Array, q: Array, torque: Array) -> Array:
    """Return the largest share of any limit at every time, (N, n)."""
    assert robot.servo is not None
    q = np.nan_to_num(q, nan=1e6)
    most = np.minimum(np.minimum(-robot.servo.low, robot.servo.high), limits.torque)
    far = np.abs(q - limits.middle) / limits.half_range
    fast = np.abs(np.gradient(q, t, axis=0)) / limits.speed
    hard = np.nan_to_num(np.abs(torque), nan=1e6) / most
    return np.asarray(np.maximum(np.maximum(far, fast), hard))


def _gap(robot: Robot, watched: Clearance, q: Array) -> float:
    """Return the least distance of bodies along positions (N, n), less what must be left [m]."""
    rows = np.unique(np.linspace(0, len(q) - 1, POSES).astype(int))
    poses = np.tile(robot.home, (len(rows), 1))
    poses[:, [robot.tree.single[joint].iq for joint in robot.joints]] = np.nan_to_num(q[rows])
    return float(watched.gaps(poses).min()) - 2 * CLEARANCE
