"""Prescribed motion of the actuated joints: Fourier series, from a file or random, or a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy
from pydantic import BaseModel, ConfigDict, Field

from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.options import MOST_SAMPLES, Period
from identifiability.foundation.output import check_writable, temporary_folder, write_bytes
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Fields, frozen
from identifiability.logs import Log, signals
from identifiability.logs.contradictions import check_units
from identifiability.logs.conventions import Conventions
from identifiability.logs.spectrum import Spectrum, choose_band
from identifiability.robot import Robot

# Prescribed motion of the actuated joints: Fourier series, from a file or at random, or a table.
#
# `PrescribedMotion` is the motion of the simulated robot; `find_motion` finds the one that a
# command names.


Amplitude = Annotated[float, Field(ge=-1e6, le=1e6)]


class SeriesEntry(BaseModel):
    """One joint: ``q = offset + Σ_k sin_k/(kω) sin(kωt) - cos_k/(kω) cos(kωt)`` [Swevers 1997].

    The coefficients are amplitudes of velocity [rad/s or m/s].
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    offset: Amplitude
    sin: list[Amplitude] = Field(min_length=1)
    cos: list[Amplitude] = Field(min_length=1)


class TrajectoryFile(BaseModel):
    """A file of named trajectories; other keys are comments."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)

    period: float = Field(ge=1e-3, le=1e6)
    samples: int = Field(ge=2, le=MOST_SAMPLES)
    trajectories: dict[str, dict[str, SeriesEntry]] = Field(min_length=1)


@frozen
class Trajectory:
    """Motion of the actuated joints as Fourier series.

    Attributes
    ----------
    name : str
    period : float [s]
    samples : int
        Samples a period.
    offset : (n,) [rad or m]
    sin, cos : (n, H) [rad/s or m/s]
        Velocity amplitudes.
    """

    name: str
    period: float
    samples: int
    offset: Array
    sin: Array
    cos: Array

    @property
    def harmonics(self) -> int:
        """Number of harmonics."""
        return int(self.sin.shape[1])

    def times(self, samples: int | None = None) -> Array:
        """Return evenly spaced times of one period, (N,) [s]."""
        count = samples or self.samples
        return np.arange(count) * self.period / count

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (N, n) at times t."""
        w = 2 * np.pi / self.period * np.arange(1, self.harmonics + 1)
        cosines = -(self.cos / w).T
        series = np.vstack([self.offset, (self.sin / w).T, cosines])
        return signals.fourier_motion(t, self.period, series)


@frozen
class PrescribedMotion:
    """Motion of the actuated joints that the simulated robot follows exactly.

    Attributes
    ----------
    t : (N,) [s]
    q, dq, ddq : (N, n)
    name : str
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    name: str = "motion"

    @staticmethod
    def of(trajectory: Trajectory, samples: int | None = None) -> PrescribedMotion:
        """Return one period of a trajectory."""
        t = trajectory.times(samples)
        return PrescribedMotion(t, *trajectory.motion(t), name=trajectory.name)


def read_trajectories(path: str | Path, robot: Robot) -> dict[str, Trajectory]:
    """Read a JSON file of trajectories for a robot.

    Raises
    ------
    LogError
        If the file is no trajectory file, or a joint is missing.
    """
    path = Path(path)
    content = read_document(path, TrajectoryFile, "JSON", "trajectory", LogError)
    out = {}
    for name, joints in content.trajectories.items():
        missing = [j for j in robot.joints if j not in joints]
        if missing:
            others = [j for j in joints if j not in robot.joints]
            raise LogError(
                f"{path}: trajectory '{name}' has no entry for {listing(missing)}"
                f"{near_match(missing[0], others)}"
            )
        rows = [joints[j] for j in robot.joints]
        if len({len(r.sin) for r in rows} | {len(r.cos) for r in rows}) != 1:
            raise LogError(f"{path}: trajectory '{name}' has joints with different harmonics.")
        offsets = [r.offset for r in rows]
        sines = np.array([r.sin for r in rows])
        cosines = np.array([r.cos for r in rows])
        out[name] = Trajectory(
            name=name,
            period=content.period,
            samples=content.samples,
            offset=np.array(offsets),
            sin=sines,
            cos=cosines,
        )
    return out


def shipped_trajectory(robot: Robot, name: str) -> Trajectory:
    """Return a trajectory by name from ``trajectories.json`` in the folder of the robot file.

    Raises
    ------
    LogError
    """
    path = robot.path.with_name("trajectories.json")
    if not path.is_file():
        raise LogError(
            f"'{name}' is neither a motion file nor a known trajectory: {robot.name} comes without "
            "trajectories; give a CSV with t and <joint>.q, or 'random'."
        )
    return _chosen(read_trajectories(path, robot), name, f"for {robot.name}")


def _chosen(known: Mapping[str, Trajectory], name: str, where: str) -> Trajectory:
    """Return a trajectory of a file by name, the first without one."""
    if name and name not in known:
        raise LogError(
            f"There is no motion file or trajectory '{name}' {where}{near_match(name, known)} It "
            f"has {', '.join(known)}; 'random' draws one."
        )
    return known[name or next(iter(known))]


#: Reach about home, speed and acceleration of joints without limits: (rotary [rad], sliding [m]).
USUAL: dict[str, tuple[Tolerance, Tolerance]] = {"q": (1.0, 0.1), "v": (2.0, 0.3), "a": (10.0, 1.0)}


def usual_limits(robot: Robot) -> dict[str, Array]:
    """Return default limits of actuated joints: positions (n, 2), speed and acceleration (n,)."""
    slides = robot.slides.astype(int)
    found = {kind: np.array(values)[slides] for kind, values in USUAL.items()}
    home = robot.actuated_positions(robot.home[None])[0]
    reach = found["q"]
    return {**found, "q": np.stack([home - reach, home + reach], 1)}


def random_trajectory(
    robot: Robot,
    rng: np.random.Generator,
    *,
    period: float = DEFAULTS.period,
    samples: int = DEFAULTS.samples,
    harmonics: int = 5,
) -> Trajectory:
    """Return a random Fourier trajectory that fills the robot's limits without leaving them.

    Joints without limits move by at most ± 1 rad or ± 0.1 m about home. Their limits are 2 rad/s or
    0.3 m/s, and 10 rad/s² or 1 m/s².
    """
    n = len(robot.actuated)
    usual = usual_limits(robot)
    low, high = np.where(np.isfinite(robot.limits), robot.limits, usual["q"]).T
    speed = np.where(np.isfinite(robot.speed_limits), robot.speed_limits, usual["v"])
    most = robot.acceleration_limits
    most = np.where(np.isfinite(most), most, usual["a"])
    sin, cos = rng.standard_normal((2, n, harmonics))
    shape = Trajectory(
        name="random",
        period=period,
        samples=samples,
        offset=np.zeros(n),
        sin=sin,
        cos=cos,
    )
    q, dq, ddq = shape.motion(shape.times())
    room = 0.95 * (high - low) / np.maximum(np.ptp(q, axis=0), 1e-12)
    faster = 0.95 * speed / np.abs(dq).max(0)
    harder = 0.95 * most / np.abs(ddq).max(0)
    scale = np.min([room, faster, harder], axis=0)
    middle = 0.5 * (low + high) - scale * 0.5 * (q.max(0) + q.min(0))
    grown = scale[:, None]
    return replace(
        shape,
        offset=middle,
        sin=grown * sin,
        cos=grown * cos,
    )


def find_motion(
    robot: Robot,
    source: str,
    samples: Period | None = None,
    rng: np.random.Generator | None = None,
) -> PrescribedMotion:
    """Return the motion that a word names.

    Parameters
    ----------
    robot : Robot
    source : str
        A log, of any format, ``FILE.json:NAME``, a shipped trajectory's name, or ``random``.
    samples : int or None
        Samples a period, for trajectories.
    rng : numpy.random.Generator, optional
        Draws the random trajectory; by default one of seed 0.

    Raises
    ------
    LogError, RobotError
    """
    robot.check_stands("simulation")
    if source == "random":
        return PrescribedMotion.of(
            random_trajectory(robot, rng or np.random.default_rng(0)), samples
        )
    stem, colon, name = source.partition(".json:")
    if colon or source.endswith(".json"):
        path = Path(f"{stem}.json" if colon else source)
        return PrescribedMotion.of(
            _chosen(read_trajectories(path, robot), name, f"in {path}"), samples
        )
    if Path(source).suffix or Path(source).exists():
        return _from_file(robot, source)
    return PrescribedMotion.of(shipped_trajectory(robot, source), samples)


def _from_file(robot: Robot, source: str) -> PrescribedMotion:
    """Read positions from a log, and derivatives where it has them."""
    known = replace(Conventions.of(robot), motion_alone=True)
    gear = robot.transmission
    motors = gear.motors if gear else ()
    log = Log.read(source, known).select(robot.joints, motors)
    if gear is not None and {*log.joints} == {*motors}:
        pairs = (("dq", log.dq), ("ddq", log.ddq))
        rates: Fields = {k: x if x is None else gear.joint_rate(x) for k, x in pairs}
        sides = gear.joint_side(log.q, log.tau)
        log = replace(log, joints=robot.joints, q=sides[0], **rates)
    check_units(robot, [log])
    if log.dq is not None and log.ddq is not None:
        return PrescribedMotion(log.t, log.q, log.dq, log.ddq, log.name)
    dt = signals.sampling_step(log.t)
    gaps = np.diff(log.t)
    # Lost samples are bridged as where a log is fitted.
    duration = log.t[-1] - log.t[0]
    t = log.t[0] + dt * np.arange(round(duration / dt) + 1)
    q = scipy.interpolate.CubicSpline(log.t, log.q)(t)
    cutoff = choose_band([Spectrum.of([q], dt)]).outputs
    longest = int(np.argmax(gaps))
    if gaps[longest] > 0.5 / cutoff:
        raise LogError(
            f"{log.name} has a gap of {gaps[longest]:.2g} s after t = {log.t[longest]:.4g} s; "
            "velocity and acceleration cannot be computed across it: split the log there."
        )
    smooth = signals.lowpass(q, dt, cutoff)
    dq = signals.differentiate(smooth, dt)
    return PrescribedMotion(t, smooth, dq, signals.differentiate(dq, dt), log.name)


# A motion as a bag that a ROS 2 controller plays: one message of ``JointTrajectory``.


TOPIC = "/joint_trajectory"


def write_trajectory_bag(path: str | Path, joints: Sequence[str], motion: PrescribedMotion) -> Path:
    """Write a motion as an MCAP file with one ``trajectory_msgs/msg/JointTrajectory``.

    Parameters
    ----------
    path : path
    joints : sequence of str
    motion : PrescribedMotion

    Raises
    ------
    LogError
        If the extra ``ros`` is missing.
    OutputError
    """
    path, store = _bag(path)
    make = store.types
    points = []
    for t, q, dq, ddq in zip(motion.t, motion.q, motion.dq, motion.ddq, strict=True):
        whole = round(float(t) * 1e9)
        after = make["builtin_interfaces/msg/Duration"](whole // 10**9, whole % 10**9)
        point = make["trajectory_msgs/msg/JointTrajectoryPoint"]
        points.append(point(q.copy(), dq.copy(), ddq.copy(), 0 * q[:0], after))
    stamp = make["builtin_interfaces/msg/Time"](0, 0)
    header = make["std_msgs/msg/Header"](stamp, "")
    kind = "trajectory_msgs/msg/JointTrajectory"
    message = make[kind](header, list(joints), points)
    return _write_mcap(path, store, TOPIC, [(0, message)])


def _bag(path: str | Path) -> tuple[Path, Any]:
    """Return where a bag can be written, and the types of its messages.

    Raises
    ------
    LogError
        If the extra ``ros`` is missing.
    """
    path = check_writable(Path(path))
    try:
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 - an extra
    except ImportError:
        raise LogError(Finding("bag.extra", path)) from None
    return path, get_typestore(Stores.ROS2_HUMBLE)


def _write_mcap(path: Path, store: Any, topic: str, messages: Sequence[tuple[int, Any]]) -> Path:
    """Write messages of a topic with their times [ns], whole or not at all."""
    from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415 - an extra

    with temporary_folder() as folder:
        bag = Path(folder) / "bag"
        with Writer(
            bag,
            version=9,
            storage_plugin=StoragePlugin.MCAP,
        ) as writer:
            kind = messages[0][1].__msgtype__
            connection = writer.add_connection(topic, kind, typestore=store)
            for at, message in messages:
                writer.write(connection, at, store.serialize_cdr(message, kind))
        (file,) = bag.glob("*.mcap")
        return write_bytes(path, file.read_bytes())
