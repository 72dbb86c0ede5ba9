"""Where gravity points, of a model with a tilted base: the direction that its fit leads to.

Masses that are fitted and gravity multiply each other: the direction is refined by Gauss–Newton
steps, each a fit of the whole model about the direction found before. These end where the angles
that are left are zero, which is the right direction whatever masses the file states. A direction
far from the file's is found before (`alternatives`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.gravity import TILTS, GravityTilt, turn_gravity
from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import remembering_covariance
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import BASE
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rules import Tolerance
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure

#: Gauss–Newton steps, and shares of its standard error by which the last one moves a direction.
STEPS = 12
SETTLED: Tolerance = 1e-3


def about_gravity(structure: Structure, samples: Sequence[Prepared]) -> Structure:
    """Return a model about the direction of gravity that its fit leads to, if it surely tilts."""
    robot, effects = structure.robot, structure.model.effects
    if GravityTilt.name not in structure.model.names or not robot.gravity.any():
        return structure
    others = [e for e in effects if e.name != GravityTilt.name]
    names, about = [f"{BASE}.{kind}" for kind in TILTS], structure
    for _ in range(STEPS):
        information = gather_information(about.regression(samples))
        fit = estimate(information)
        at = [about.base.names.index(n) for n in names if n in about.base.names]
        value = dict(zip(about.base.names, fit.value, strict=True))
        step = np.array([value.get(n, 0.0) for n in names])
        variance = np.zeros(len(fit.columns))  # of a column that the logs leave out, none
        variance[list(fit.kept)] = np.diag(remembering_covariance(information, fit))
        error = float(np.sqrt(variance[at].mean())) if at else 0.0
        size = float(np.linalg.norm(step))
        if size <= max(SETTLED * error, ROUNDOFF):
            break
        turned = turn_gravity(about.robot, step * min(1.0, 0.5 / size))  # no step is longer [rad]
        about = Structure.of(robot, Model((*others, GravityTilt(turned.gravity))))
    tilt = about.robot.tilt
    sure = tilt is not None and 0 < REACH * float(np.degrees(error)) < tilt.degrees
    return about if sure else structure
