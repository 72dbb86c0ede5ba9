"""Prescribed motion of the actuated joints: finite Fourier series, from a file or at random."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import LogError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot

#: Longer simulated logs are refused; the simulator takes one sample at a time.
MOST_SAMPLES = 10_000_000

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
    trajectories: dict[str, dict[str, SeriesEntry]]


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

    def times(self, samples: int | None = None) -> Array:
        """Return evenly spaced times of one period, (N,) [s]."""
        count = samples or self.samples
        times: Array = np.arange(count) * self.period / count
        return times

    def motion(self, t: Array) -> tuple[Array, Array, Array]:
        """Return q, dq, ddq (N, n) at times t."""
        w = 2 * np.pi / self.period * np.arange(1, self.sin.shape[1] + 1)
        S, C = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
        q = self.offset + (S / w) @ self.sin.T - (C / w) @ self.cos.T
        dq = C @ self.sin.T + S @ self.cos.T
        ddq = -(S * w) @ self.sin.T + (C * w) @ self.cos.T
        return q, dq, ddq


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
        out[name] = Trajectory(
            name, content.period, content.samples, np.array([r.offset for r in rows]),
            np.array([r.sin for r in rows]), np.array([r.cos for r in rows]),
        )  # fmt: skip
    return out


def shipped_trajectory(robot: Robot, name: str) -> Trajectory:
    """Return a trajectory by name from ``trajectories.json`` beside the robot file.

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
    known = read_trajectories(path, robot)
    if name not in known:
        raise LogError(
            f"There is no motion file or trajectory '{name}' for {robot.name}"
            f"{near_match(name, known)} It has {', '.join(known)}; 'random' draws one."
        )
    return known[name]


def random_trajectory(
    robot: Robot,
    rng: np.random.Generator,
    *,
    period: float = 7.5,
    samples: int = 750,
    harmonics: int = 5,
) -> Trajectory:
    """Return a random Fourier trajectory that fills the robot's limits without leaving them.

    Joints without limits move by at most ± 1 rad or ± 0.1 m about home, at 2 rad/s or 0.3 m/s and
    10 rad/s² or 1 m/s².
    """
    n = len(robot.actuated)
    slides = np.array([robot.is_prismatic(int(k)) for k in robot.actuated])
    home = robot.actuated_positions(robot.home[None])[0]
    low, high = robot.limits.T
    reach = np.where(slides, 0.1, 1.0)
    low = np.where(np.isfinite(low), low, home - reach)
    high = np.where(np.isfinite(high), high, home + reach)
    speed = np.where(np.isfinite(robot.speed_limits), robot.speed_limits, np.where(slides, 0.3, 2))
    most = robot.acceleration_limits
    most = np.where(np.isfinite(most), most, np.where(slides, 1.0, 10.0))
    amplitude = rng.standard_normal((2, n, harmonics))
    shape = Trajectory("random", period, samples, np.zeros(n), amplitude[0], amplitude[1])
    q, dq, ddq = shape.motion(shape.times())
    scale = np.min(
        [
            0.95 * (high - low) / np.maximum(np.ptp(q, axis=0), 1e-12),
            0.95 * speed / np.abs(dq).max(0),
            0.95 * most / np.abs(ddq).max(0),
        ],
        axis=0,
    )
    middle = 0.5 * (low + high) - scale * 0.5 * (q.max(0) + q.min(0))
    return Trajectory(
        "random",
        period,
        samples,
        middle,
        scale[:, None] * amplitude[0],
        scale[:, None] * amplitude[1],
    )
