"""`Excitation`: a motion to measure, its merit, and the limits that it keeps.

A controller plays it from rest, into the periods, back to rest.
"""

from collections.abc import Mapping
from functools import cached_property
from io import BytesIO
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.errors import ClosureError, LogError
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import MOST_SAMPLES
from identifiability.foundation.output import check_ending, csv_text, write_bytes, write_text
from identifiability.foundation.presenter import presented
from identifiability.foundation.result import Result
from identifiability.foundation.values import Json, frozen
from identifiability.robot import Robot, complete_motion
from identifiability.simulation.motion import PrescribedMotion, Trajectory, write_trajectory_bag

from .criteria import Criterion
from .limits import CLEARANCE, Clearance, Drive, Limits, survey

# From a periodic motion to a motion for a controller: from rest, into the periods, back to rest.
#
# The motion stands still in the middle of its range, grows to the full periods, and shrinks back:
# ``q = c + w(t) (q_F(t) - c)`` with a window w that rises from 0 to 1 with two continuous
# derivatives (a quintic). The position is then always between middle and full motion, so limits of
# position are kept; the rise is made so long that those of speed and acceleration are kept as
# well.


def _windowed(path: Trajectory, rise: float, rate: float, periods: int) -> PrescribedMotion:
    whole = 2 * rise + periods * path.period
    t = np.arange(round(whole * rate) + 1) / rate
    nearest_end = np.minimum(t, t[-1] - t)
    up = np.clip(nearest_end / rise, 0.0, 1.0)[:, None]
    side = np.where(t < t[-1] / 2, 1.0, -1.0)[:, None] / rise
    w = up**3 * (10 - 15 * up + 6 * up**2)
    dw = 30 * up**2 * (1 - up) ** 2 * side
    ddw = 60 * up * (1 - up) * (1 - 2 * up) * side**2
    q, dq, ddq = path.motion(t - rise)
    full = path.motion(path.times())[0]
    middle = 0.5 * (full.max(0) + full.min(0))
    away = q - middle
    bent = ddw * away + 2 * dw * dq
    return PrescribedMotion(
        t,
        middle + w * away,
        dw * away + w * dq,
        bent + w * ddq,
        path.name,
    )


def _keeps(
    robot: Robot,
    motion: PrescribedMotion,
    limits: Limits,
    drive: Drive | None,
    watched: Clearance | None,
) -> bool:
    """Return whether a motion keeps every limit, of loops and workspace too, and bodies apart."""
    fast = np.abs(motion.dq).max(0) / limits.speed
    hard = np.abs(motion.ddq).max(0) / limits.acceleration
    if max(fast.max(), hard.max()) > 1 + NEARLY:
        return False
    try:
        whole = complete_motion(robot, motion.t, motion.q, motion.dq, motion.ddq)
    except ClosureError:
        return False
    step = float(motion.t[1] - motion.t[0])
    space = survey(robot, limits, whole, len(motion.t), 1, step, drive)
    if not space.kept(limits.closure_bound)[0]:
        return False
    if watched is None:
        return True
    return float(watched.gaps(whole.q).min()) >= CLEARANCE


# `Excitation`: a motion to measure, its merit, and the limits that it keeps.


@frozen
class Merit:
    """Information of a motion, together with earlier logs.

    Attributes
    ----------
    figure : float
        Log-det of the information, or standard deviations.
    sigma : (k,)
        Standard deviations under white noise, up to a factor shared by all motions compared.
    told : (c,) bool
        Columns of the criterion with an expected standard deviation of 20 % or less.
    """

    figure: float
    sigma: Array
    told: np.ndarray

    @property
    def identifiable(self) -> int:
        """Number of these columns."""
        return int(self.told.sum())


@frozen(kw_only=True)
class Excitation(Result):
    """A motion within limits with the best criterion that the search found.

    `to_frame` has one row a joint: its motion, and the limits that it keeps.

    Attributes
    ----------
    robot : Robot
    trajectory : Trajectory
    criterion : Criterion
    effects : tuple of str
        Of the model.
    names, units : tuple of str
        Of the k columns.
    chosen : tuple of str
        Parameters or effects that the criterion is about; empty for all.
    logs : tuple of str
        Logs that were measured already.
    before, after : Merit
        Of the same logs measured again, or of a random motion in the middle of many within the
        same limits; and of the trajectory.
    limits : Limits
    drive : Drive or None
        The model that predicts torque, if any drive has a limit.
    torque : (n,)
        Largest predicted torque of each drive; empty if none has a limit.
    closure : float
        Largest condition number of the closure along the motion; 1 for an open chain.
    evaluations : int
        Motions looked at.
    seed : int
    gap : float [m]
        Least distance of unconnected bodies at any sample; infinite where none is watched.
    hints : tuple of str
        Unused inputs, assumptions, and pairs that are not watched.
    provenance : mapping
        Versions, seed, options, and hashes of the inputs.
    """

    schema = "identifiability/excitation/1"

    robot: Robot
    trajectory: Trajectory
    criterion: Criterion
    effects: Strings
    names: Strings
    units: Strings
    chosen: Strings
    logs: Strings
    before: Merit
    after: Merit
    limits: Limits
    drive: Drive | None
    torque: Array
    closure: float
    evaluations: int
    seed: int
    gap: float = np.inf
    hints: Strings = ()
    provenance: Mapping[str, str] = {}

    @property
    @presented
    def beside(self) -> str:
        """Description of the motion of `before`."""
        raise NotImplementedError

    @cached_property
    def motion(self) -> tuple[Array, Array, Array, Array]:
        """Times (N,) [s], positions, velocities and accelerations (N, n)."""
        t = self.trajectory.times()
        return t, *self.trajectory.motion(t)

    @property
    def gain(self) -> Array:
        """Standard deviations relative to those of `before`, (k,); NaN where these are zero."""
        before = self.before.sigma
        unknown = np.full(len(before), np.nan)
        return np.divide(self.after.sigma, before, out=unknown, where=before > 0)

    @presented
    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a column: how its standard deviation changes."""
        raise NotImplementedError

    def play(self, rate: float = DEFAULTS.rate, periods: int = 1) -> PrescribedMotion:
        """Return the motion for a controller: from rest, through whole periods, back to rest.

        Parameters
        ----------
        rate : float [Hz]
            Samples a second.
        periods : int
            Whole periods between lead-in and lead-out.

        Raises
        ------
        LogError
            If it would have too many samples, or no lead-in keeps the limits.
        """
        path = self.trajectory
        limits = self.limits
        longest = path.period * (periods + 2 * 4)
        if longest * rate > MOST_SAMPLES:
            raise LogError(Finding("excite.long", seconds=longest, rate=rate, most=MOST_SAMPLES))
        watched = Clearance.of(self.robot)[0]
        for rise in path.period * 2.0 ** np.arange(-2, 3):  # up to four periods
            motion = _windowed(path, rise, rate, periods)
            if _keeps(self.robot, motion, limits, self.drive, watched):
                return motion
        raise LogError(Finding("excite.rest", motion=path.name, robot=self.robot.name))

    def to_dict(self) -> Json:
        """Return a trajectory file with the properties of the trajectory."""
        path = self.trajectory
        places = enumerate(self.limits.joints)
        joints = {
            name: {
                "offset": path.offset[k],
                "sin": path.sin[k].tolist(),
                "cos": path.cos[k].tolist(),
            }
            for k, name in places
        }
        identifiable = [self.before.identifiable, self.after.identifiable]
        joints_each = self.to_frame().to_dict("records")
        parameters = self.parameters_frame().to_dict("records")
        return {
            "schema": self.schema,
            "comment": f"{self.statement} Coefficients are amplitudes of velocity.",
            "period": path.period,
            "samples": path.samples,
            "trajectories": {path.name: joints},
            "robot": self.robot.name,
            "criterion": self.criterion.name,
            "chosen": list(self.chosen),
            "effects": list(self.effects),
            "logs": list(self.logs),
            "identifiable": identifiable,
            "before": self.before.figure,
            "after": self.after.figure,
            "closure": self.closure,
            **({"gap": self.gap} if np.isfinite(self.gap) else {}),
            "joints": joints_each,
            "parameters": parameters,
            "evaluations": self.evaluations,
            "seed": self.seed,
            "hints": list(self.hints),
            "provenance": dict(self.provenance),
        }

    def write_motion(self, path: str | Path, rate: float = DEFAULTS.rate, periods: int = 1) -> Path:
        """Write the motion as a controller plays it, from rest to rest (`play`).

        Parameters
        ----------
        path : path
            CSV with t, JOINT.q, JOINT.dq and JOINT.ddq, and JOINT.cmd of position servos, which
            take positions as commands; NumPy arrays (.npz: t, q, dq, ddq, joints); or an MCAP bag
            with one message of ``trajectory_msgs/JointTrajectory`` (extra ``ros``).
        rate : float [Hz]
        periods : int

        Raises
        ------
        LogError, OutputError
        """
        check_ending(path, ".csv", ".npz", ".mcap")
        motion = self.play(rate, periods)
        joints = self.limits.joints
        each = {"q": motion.q, "dq": motion.dq, "ddq": motion.ddq}
        ending = Path(path).suffix.lower()
        if ending == ".mcap":
            return write_trajectory_bag(path, joints, motion)
        if ending == ".npz":
            packed = BytesIO()
            np.savez(packed, t=motion.t, q=motion.q, dq=motion.dq, ddq=motion.ddq, joints=joints)
            return write_bytes(path, packed.getvalue())
        told = each if self.robot.servo is None else {**each, "cmd": motion.q}
        columns = {
            f"{joint}.{kind}": x[:, k] for k, joint in enumerate(joints) for kind, x in told.items()
        }
        return write_text(path, csv_text(pd.DataFrame({"t": motion.t, **columns})))

    @property
    @presented
    def worth(self) -> str:
        """Description of the merit of the motion; empty for motions of `diagnose --next`."""
        raise NotImplementedError

    @property
    @presented
    def limits_statement(self) -> str:
        """Description of the limits that the motion keeps."""
        raise NotImplementedError
