"""The gap in motion: simulate forward from measured states, before and after the named effects.

The torque-level gap says how well a model explains torques. A user simulates with a model, so the
second half of the proof is motion: stretches of unseen motion are started from measured states and
driven by the measured torque, with the nearest real robot of either model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identifiability.effects import Effect, find_family
from identifiability.estimation.estimate import estimate
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.shares import ENDS
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare import Samples
from identifiability.physical.feasibility import FittedModel, assess_feasibility
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import full_rung
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.simulation.forward import Extra, ForwardRobot
from identifiability.workflows.diagnose.forward_gap import HORIZON, ForwardGap

if TYPE_CHECKING:
    from identifiability.workflows.diagnose.findings import Findings

#: Simulated stretches, at most.
STRETCHES = 24

#: Repetitions for intervals.
DRAWS = 2000


def _change(gap: ForwardGap, rng: np.random.Generator) -> tuple[float, float]:
    """Return the 95 % interval of the change, stretches drawn again and again."""
    before, after = gap.shares()
    change = after[:, -1] - before[:, -1]
    drawn = change[rng.integers(0, len(change), (DRAWS, len(change)))].mean(1)
    low, high = np.quantile(drawn, ENDS)
    return float(low), float(high)


@frozen
class Physical:
    """A model with the values of a real robot.

    Attributes
    ----------
    model : Model
    values : mapping
        Standard parameters by name.
    """

    model: Model
    values: Mapping[str, float]


def fit_physical(structure: Structure, samples: Sequence[Samples]) -> Physical:
    """Return the real robot that explains some logs best under a model.

    Raises
    ------
    IdentifiabilityError
        If the solver finds none.
    """
    information = gather_information(structure.regression(samples))
    rung, fit = full_rung(structure.base), estimate(information)
    found = assess_feasibility(FittedModel(structure, rung, information, information, fit))
    if found.nearest is None:
        raise IdentifiabilityError(found.sentence)
    return Physical(structure.model, found.parameters())


def compare_forward(
    robot: Robot,
    before: Physical,
    after: Physical,
    unseen: Sequence[Samples],
    rng: np.random.Generator,
    horizon: float = HORIZON,
    stretches: int = STRETCHES,
) -> ForwardGap:
    """Simulate stretches of unseen motion with two models.

    Parameters
    ----------
    robot : Robot
    before, after : Physical
    unseen : sequence of Samples
        Logs that neither was fitted to.
    rng : numpy.random.Generator
        For the interval.
    horizon : float [s]
    stretches : int
        At most; evenly spaced over the logs.

    Returns
    -------
    ForwardGap
        With a note instead of numbers where MuJoCo cannot simulate this robot.
    """
    starts = _starts(unseen, horizon, stretches)
    if not starts:
        return ForwardGap.none(
            f"no stretch of {horizon:g} s without gaps is left in the unseen motion"
        )
    dt = signals.sampling_step(unseen[0].motion.t)
    steps = max(2, round(horizon / dt))
    at = [np.arange(start, start + steps + 1) for _, start in starts]
    q = np.stack([unseen[s].motion.actuated_q[r] for (s, _), r in zip(starts, at, strict=True)])
    first = np.stack(
        [unseen[s].motion.actuated_v[r[0]] for (s, _), r in zip(starts, at, strict=True)]
    )
    moved = np.abs(np.diff(q, axis=1)).sum(1).mean(0)
    if not np.all(moved > 0):
        return ForwardGap.none("a joint does not move in the unseen motion")
    errors = []
    try:
        for fit in (before, after):
            tau = np.stack(
                [
                    _mean_torque(robot, fit, unseen[s], r)
                    for (s, _), r in zip(starts, at, strict=True)
                ]
            )
            simulator = ForwardRobot(robot, joint_values(robot, fit))
            positions = simulator.run(q[:, 0], first, tau, dt, extra_effects(robot, fit))
            errors.append(positions - q[:, 1:])
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    t = dt * np.arange(1, steps + 1)
    gap = ForwardGap(steps * dt, t, moved, errors[0], errors[1])
    return replace(gap, interval=_change(gap, rng))


def _starts(unseen: Sequence[Samples], horizon: float, most: int) -> list[tuple[int, int]]:
    """Return (log, first row) of evenly spaced stretches without gaps."""
    dt = signals.sampling_step(unseen[0].motion.t)
    steps = max(2, round(horizon / dt))
    found = []
    for log, samples in enumerate(unseen):
        kept, start = samples.motion.kept, 0
        if abs(signals.sampling_step(samples.motion.t) / dt - 1) > 0.01:
            continue  # one step size for all
        while start + steps < len(kept):
            if kept[start + steps] - kept[start] == steps:
                found.append((log, start))
                start += steps
            else:
                start += 1 + int(np.argmax(np.diff(kept[start : start + steps + 1]) > 1))
    if len(found) <= most:
        return found
    return [found[k] for k in np.linspace(0, len(found) - 1, most).astype(int)]


def _mean_torque(robot: Robot, fit: Physical, samples: Samples, rows: np.ndarray) -> Array:
    """Return the torque over each step, (S, n): what was recorded, less its delay."""
    t, tau = samples.motion.t, samples.tau
    out = np.empty((len(rows), tau.shape[1]))
    for k, joint in enumerate(robot.joints):
        delay = fit.values.get(f"{joint}.delay", 0.0)
        out[:, k] = np.interp(t[rows] + delay, t, tau[:, k])
    middle: Array = 0.5 * (out[1:] + out[:-1])
    return middle


def joint_values(robot: Robot, fit: Physical) -> dict[str, float]:
    """Return parameters as bodies and joints hold them: payloads in bodies, two Coulomb levels."""
    names = [p.name for p in fit.model.parameters(robot)]
    values = {name: fit.values.get(name, 0.0) for name in names}
    out = {f"{b}.{k}": values.get(f"{b}.{k}", 0.0) + values.get(f"{b}.payload_{k}", 0.0)
           for b in robot.bodies for k in INERTIAL_KINDS}  # fmt: skip
    # What a model does not have is not there, whatever the file says.
    for axis in (*robot.axes, *robot.passive_axes):
        for kind in ("Fv", "off", *robot.inertia_parts):
            out[f"{axis.name}.{kind}"] = values.get(f"{axis.name}.{kind}", 0.0)
        level = values.get(f"{axis.name}.Fc", 0.0)
        for way in ("Fc+", "Fc-"):
            out[f"{axis.name}.{way}"] = level + values.get(f"{axis.name}.{way}", 0.0)
    return out


def extra_effects(robot: Robot, fit: Physical) -> Extra | None:
    """Return what the model has and MuJoCo does not, or None."""
    of = {e: find_family(e.name) for e in fit.model.effects}
    others = [(e, _values_of(robot, e, fit)) for e in of if not of[e].native]
    if not others:
        return None
    smooth = [(e, value) for e, value in others if not of[e].dry]
    dry = [(e, value) for e, value in others if of[e].dry]

    def extra(q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        motion = complete_motion(robot, np.arange(len(q), dtype=float), q, dq, ddq)
        torque, level = np.zeros_like(q), np.zeros_like(q)
        for parts, out in ((smooth, torque), (dry, level)):
            for effect, value in parts:
                W = np.zeros((len(motion), q.shape[1], len(value)))
                effect.fill(robot, motion, W)
                out[motion.kept] += W @ value
        return torque, level * np.sign(dq)

    return extra


def _values_of(robot: Robot, effect: Effect, fit: Physical) -> Array:
    return np.array([fit.values.get(p.name, 0.0) for p in effect.parameters(robot)])


def simulate_forward(d: Findings, rng: np.random.Generator) -> ForwardGap:
    """Return the gap in motion of a diagnosis, on the motion that verified it."""
    try:
        if d.fixed:
            before = Physical(d.structure.model, d.robot.nominal)
            after = Physical(d.model, _with_named(d))
        else:
            before, after = (fit_physical(s, d.samples) for s in (d.structure, d.completed))
    except IdentifiabilityError as error:
        return ForwardGap.none(str(error))
    return compare_forward(d.robot, before, after, d.validation, rng)


def _with_named(d: Findings) -> dict[str, float]:
    """Return the file's values with what the named effects add."""
    stated = {p.name for e in d.base_effects for p in e.parameters(d.robot)}
    values = dict(d.robot.nominal)
    for placement in (p for e in d.effects for p in e.placements):
        for name, value in zip(placement.parameters, placement.values, strict=True):
            values[name] = float(value) + (values.get(name, 0.0) if name in stated else 0.0)
    return values
