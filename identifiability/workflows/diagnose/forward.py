"""The gap in motion: simulate forward from measured states, before and after the named effects.

The torque-level gap says how well a model explains torques. Users simulate with a model, so motion
is the second test. Stretches of unseen motion start from measured states and are driven by the
measured torque. Both models use their nearest physically consistent robot.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np

from identifiability.effects import find_family
from identifiability.estimation.prediction import DRAWN_STRETCHES, change_interval
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName, Parameter
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare import Dataset
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.structure import Structure
from identifiability.robot import Motion
from identifiability.simulation.forward import ForwardRobot

#: Length of a simulated stretch [s].
HORIZON: Tolerance = 0.25


@frozen
class ForwardGap:
    """Position errors of simulated stretches of motion that was not fitted.

    Attributes
    ----------
    horizon : float [s]
    t : (S,) [s]
        Time since the start of a stretch.
    before, after : (K, S, n)
        Simulated less measured position, as a share of the distance that the joint moved in a
        stretch on average; a diverged stretch counts as an error of the whole distance.
    interval : (float, float)
        95 % interval of the change of the error, from resampled stretches.
    note : str
        Reason why there is no gap; else empty.
    nearest : Physical or None
        The physically consistent robot with the named effects, if it was found.
    """

    horizon: float
    t: Array
    before: Array
    after: Array
    interval: tuple[float, float] = (np.nan, np.nan)
    note: str = ""
    nearest: Physical | None = None

    @staticmethod
    def none(note: str) -> ForwardGap:
        """Return an empty gap with the reason why it was not measured."""
        empty = np.empty((0, 0, 0))
        return ForwardGap(HORIZON, np.empty(0), empty, empty, note=note)

    @property
    def measured(self) -> bool:
        """Whether there is a gap at all."""
        return len(self.before) > 0

    @property
    def error_before(self) -> float:
        """Mean share at the end of a stretch, base model."""
        if self.measured:
            return float(self.before[:, -1].mean())
        return np.nan

    @property
    def error_after(self) -> float:
        """The same with the named effects."""
        if self.measured:
            return float(self.after[:, -1].mean())
        return np.nan


@frozen
class Physical:
    """A robot under a model with physically consistent values.

    Attributes
    ----------
    structure : Structure
    values : mapping
        Standard parameters by name.
    cad_weight : float
        Weight of the prior around the robot file.
    """

    structure: Structure
    values: NumberByName
    cad_weight: float = 0.0

    def of(self, parameters: Iterable[Parameter]) -> dict[str, float]:
        """Return the values of some parameters, zero where there is none."""
        return {p.name: self.values.get(p.name, 0.0) for p in parameters}


#: Samples and their rows, (S + 1,) int, of each stretch.
Stretches = list[tuple[Dataset, np.ndarray]]


def compare_forward(
    before: Physical,
    after: Physical,
    unseen: Sequence[Dataset],
    rng: np.random.Generator,
) -> ForwardGap:
    """Simulate stretches of unseen motion with two models of a robot.

    Parameters
    ----------
    before, after : Physical
    unseen : sequence of Dataset
        Logs that neither was fitted to.
    rng : numpy.random.Generator
        For the interval.

    Returns
    -------
    ForwardGap
        With a note instead of numbers where MuJoCo cannot simulate this robot.
    """
    if before.structure.robot.torque.has_side("both"):
        return ForwardGap.none("torque was measured on both sides of gears")
    dt = signals.sampling_step(unseen[0].motion.t)
    steps = max(2, round(HORIZON / dt))
    at = _stretches(unseen, dt, steps, DRAWN_STRETCHES)
    if not at:
        return ForwardGap.none(
            f"no stretch of {HORIZON:g} s without gaps is left in the unseen motion"
        )
    q = np.stack([s.motion.actuated_q[rows] for s, rows in at])
    moved = np.abs(np.diff(q, axis=1)).sum(1).mean(0)
    if not np.all(moved > 0):
        return ForwardGap.none("a joint does not move in the unseen motion")
    try:
        errors = [_simulate(fit, unseen, at, dt) / moved for fit in (before, after)]
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    # A diverged stretch counts as an error of the whole distance.
    errors = [np.nan_to_num(np.minimum(share, 1.0), nan=1.0) for share in errors]
    ends = np.stack([share[:, -1:].mean(2) for share in errors], axis=2)
    interval = change_interval(ends, np.ones((len(at), 1)), rng)
    return ForwardGap(steps * dt, dt * np.arange(1, steps + 1), errors[0], errors[1], interval)


def _simulate(fit: Physical, unseen: Sequence[Dataset], at: Stretches, dt: float) -> Array:
    """Return the errors of simulated positions, (K, S, n).

    Parameters
    ----------
    fit : Physical
    unseen : sequence of Dataset
    at : sequence of (Dataset, (S + 1,) int)
        Stretches of these.
    dt : float [s]
    """
    others = {id(s): other_torque(fit, s.motion) for s in unseen}
    tau = np.stack([_mean_torque(fit, s, others[id(s)], rows) for s, rows in at])
    q = np.stack([s.motion.actuated_q[rows] for s, rows in at])
    first = np.stack([s.motion.actuated_v[rows[0]] for s, rows in at])
    simulator = ForwardRobot(fit.structure.robot, joint_values(fit))
    simulated = simulator.run(q[:, 0], first, tau, dt) - q[:, 1:]
    return np.abs(simulated)


def _stretches(unseen: Sequence[Dataset], dt: float, steps: int, most: int) -> Stretches:
    """Return evenly spaced stretches without gaps."""
    found = []
    for samples in unseen:
        kept = samples.motion.kept
        t = samples.motion.t
        start = 0
        if abs(signals.sampling_step(t) / dt - 1) > LOG_RULES.small:
            continue  # one step size for all
        while start + steps < len(kept):
            rows = np.arange(start, start + steps + 1)
            jumps = np.diff(kept[rows]) > 1
            if not jumps.any() and np.diff(t[rows]).max() < LOG_RULES.gap * dt:
                found.append((samples, rows))
                start += steps
            else:
                start += 1 + int(np.argmax(jumps))
    if len(found) <= most:
        return found
    places = np.linspace(0, len(found) - 1, most)
    return [found[k] for k in places.astype(int)]


def _mean_torque(fit: Physical, samples: Dataset, others: Array, rows: np.ndarray) -> Array:
    """Return the mean torque of each step, (S, n), corrected for delay, minus `others`.

    Parameters
    ----------
    fit : Physical
    samples : Dataset
    others : (N, n)
        Torque of effects that MuJoCo does not have.
    rows : (S + 1,) int
    """
    t = samples.motion.t
    tau = samples.tau
    out = np.empty((len(rows), tau.shape[1]))
    for k, joint in enumerate(fit.structure.robot.joints):
        delay = fit.values.get(f"{joint}.delay", 0.0)
        shifted = np.interp(t[rows] + delay, t, tau[:, k])
        out[:, k] = shifted - others[rows, k]
    return 0.5 * (out[1:] + out[:-1])


def other_torque(fit: Physical, motion: Motion) -> Array:
    """Return the torque (N, n) of effects that MuJoCo lacks, along a measured motion.

    Simulated motion stays close to the measured motion within a stretch. Hysteresis of friction and
    drift over a session are taken from the log.
    """
    robot = fit.structure.robot
    out = np.zeros((len(motion), len(robot.joints)))
    for effect in fit.structure.model.effects:
        if not find_family(effect.name).native:
            known = fit.of(effect.parameters(robot))
            W = np.zeros((*out.shape, len(known)))
            effect.fill(robot, motion, W)
            out += W @ np.array([*known.values()])
    return out


def joint_values(fit: Physical) -> dict[str, float]:
    """Return parameters as bodies and joints hold them: payloads in bodies, two Coulomb levels."""
    robot = fit.structure.robot
    values = fit.of(fit.structure.parameters)
    out = {}
    for body, kind in product(robot.bodies, INERTIAL_KINDS):
        load = values.get(f"{body}.payload_{kind}", 0.0)
        out[f"{body}.{kind}"] = values.get(f"{body}.{kind}", 0.0) + load
    # Effects that the model lacks are zero, even if the file states them.
    for axis in (*robot.axes, *robot.passive_axes):
        for kind in ("Fv", "K", "off", *robot.inertia_parts):
            out[f"{axis.name}.{kind}"] = values.get(f"{axis.name}.{kind}", 0.0)
        level = values.get(f"{axis.name}.Fc", 0.0)
        for way in ("Fc+", "Fc-"):
            out[f"{axis.name}.{way}"] = level + values.get(f"{axis.name}.{way}", 0.0)
    return out
