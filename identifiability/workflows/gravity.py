"""Where gravity points: whether a base stands otherwise than its robot file says, and how.

The torque of known bodies is linear in gravity as a vector, so that the file's masses give its
direction at once, however far from the file's it is. Masses that are fitted and gravity multiply
each other: the direction is refined by Gauss–Newton steps, each a fit of the whole model about the
direction found before. These end where the angles that are left are zero, which is the right
direction whatever masses the file states.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.gravity import TILTS, GravityTilt, turn_gravity
from identifiability.effects.nominal import gravity_torque
from identifiability.estimation.estimate import estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.uncertainty import remembering_covariance
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import BASE, Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot.description import Tilt
from identifiability.workflows.oddities import MeasuredLogs
from identifiability.workflows.oddities.check import without
from identifiability.workflows.rules import RULES

#: Gauss–Newton steps, the longest of them [rad], and the change that ends them, in standard errors.
STEPS = 12


@frozen(kw_only=True)
class Leaning:
    """A model about the direction of gravity that its fit leads to.

    Attributes
    ----------
    structure : Structure
        Of a robot under that gravity, with `GravityTilt` about it in the model.
    fit : Estimate
    information : Information
        About its base parameters.
    sd : float [°]
        Standard error of the direction, about the axes about which it shows.
    axes : int
        About how many of two axes across it the motion shows how it leans.
    """

    structure: Structure
    fit: Estimate
    information: Information
    sd: float
    axes: int = 2

    @property
    def tilt(self) -> Tilt:
        """Where gravity points."""
        tilt = self.structure.robot.tilt
        assert tilt is not None
        return tilt

    @property
    def text(self) -> str:
        """Where gravity points and how surely, after "gravity"."""
        part = "" if self.axes == len(TILTS) else ", seen about one axis alone"
        return self.tilt.text.replace("°", f" ± {REACH * self.sd:.2g}°", 1) + part

    def to_dict(self) -> dict[str, object]:
        """Return it as plain values."""
        return {**self.tilt.to_dict(), "degrees_sd": self.sd, "axes": self.axes}


def settle_direction(
    structure: Structure, samples: Sequence[Prepared], direction: Array
) -> Leaning:
    """Return a model about the direction of gravity that its fit leads to.

    Parameters
    ----------
    structure : Structure
        With the effect `gravity_tilt` or without.
    samples : sequence of Samples or LongSamples
    direction : (3,)
        To begin with.
    """
    others = [e for e in structure.model.effects if e.name != GravityTilt.name]
    names = [f"{BASE}.{kind}" for kind in TILTS]
    for _ in range(STEPS):
        model = Model((*others, GravityTilt(direction)))
        about = Structure.of(structure.robot, model)
        information = gather_information(about.regression(samples))
        fit = estimate(information)
        value = dict(zip(about.base.names, fit.value, strict=True))
        step = np.array([value.get(name, 0.0) for name in names])
        at = [about.base.names.index(n) for n in names if n in value]
        variance = np.zeros(len(fit.columns))  # of a column that the logs leave out, none
        variance[list(fit.kept)] = np.diag(remembering_covariance(information, fit))
        size, error = (
            float(np.linalg.norm(step)),
            float(np.sqrt(variance[at].mean())) if at else 0.0,
        )
        # Gauss–Newton steps, the longest of them [rad], and the change that ends them, in
        # standard errors.
        if size <= max(1e-3 * error, ROUNDOFF):
            break
        # Gauss–Newton steps, the longest of them [rad], and the change that ends them, in
        # standard errors.
        direction = turn_gravity(about.robot, step * min(1.0, 0.5 / size)).gravity
    sd, seen = float(np.degrees(error)), int(np.sum(fit.determined[at]))
    return Leaning(structure=about, fit=fit, information=information, sd=sd, axes=seen)


def settle_tilt(structure: Structure, samples: Sequence[Prepared]) -> Leaning | None:
    """Return a model with a tilt about the direction that it leads to; None if none is sure.

    Parameters
    ----------
    structure : Structure
        With the effect `gravity_tilt`.
    samples : sequence of Samples or LongSamples
    """
    if not structure.robot.gravity.any():
        return None
    found = settle_direction(structure, samples, structure.robot.gravity)
    tilt = found.structure.robot.tilt
    sure = tilt is not None and 0 < REACH * found.sd < tilt.degrees
    return found if sure else None


def about_gravity(structure: Structure, samples: Sequence[Prepared]) -> Structure:
    """Return a model about the direction of gravity that it leads to, if it has a tilt at all."""
    found = settle_tilt(structure, samples) if GravityTilt.name in structure.model.names else None
    return structure if found is None else found.structure


def propose_leaning(logs: MeasuredLogs) -> Leaning | None:
    """Return gravity far from the file's, if that is where fits lead to; whether it is the judge's.

    Parameters
    ----------
    logs : MeasuredLogs
        Of logs under a model with bodies, and without `gravity_tilt`.
    """
    structure, robot = logs.structure, logs.robot
    if GravityTilt.name in structure.model.names or not (logs.weighs and robot.gravity.any()):
        return None
    start = _gravity_by_file(logs)
    if Tilt.of(robot.gravity, start).degrees < RULES.tilt_large:
        return None
    found = settle_direction(structure, logs.samples, start)
    return found if found.tilt.degrees - REACH * found.sd >= RULES.tilt_large else None


def _gravity_by_file(logs: MeasuredLogs) -> Array:
    """Return gravity (3,) [m/s²] by the file's masses, beside what any drive adds at its joint."""
    robot, motion = logs.robot, logs.motion
    each = np.stack([gravity_torque(robot, motion, axis) for axis in np.eye(3)], axis=2)
    left = logs.torque - (logs.predicted - logs.gravity)
    size = np.std(left, axis=0)
    size = np.where(size > 0, size, np.inf)
    rows, aims = [], []
    for k in range(len(logs.joints)):
        drive = logs.ordinary(k)
        rows.append(without(each[:, k], drive) / size[k])
        aims.append(without(left[:, k], drive) / size[k])
    found: Array = np.linalg.lstsq(np.concatenate(rows), np.concatenate(aims), rcond=1e-6)[0]
    return found if found.any() else robot.gravity
