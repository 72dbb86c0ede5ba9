"""The load of a robot by what its logs say, not by the masses of its file alone.

Friction and gains depend on the torque of the model. File masses are off by a tenth or more, and
files seldom state rotors and friction; a fit of the model has them all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import FAMILIES
from identifiability.effects.nominal import has_masses, reference_values
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rules import Tolerance
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

#: Share of the torque's square below which a fit leaves rounding.
EXACT: Tolerance = 1e-12
#: Share by which a body is taken to differ from its file.
SHARE: Tolerance = 0.5
#: Share of the usual mass that a body is taken to have at least.
LEAST: Tolerance = 0.1
#: What a compact load of 1 kg has of each inertial parameter, by its radius [m].
RADIUS: Tolerance = 0.1
LOAD = {kind: RADIUS ** min(k, 1 + (k > 3)) for k, kind in enumerate(INERTIAL_KINDS)}


def fit_loads(structure: Structure, X: Array, y: Array, data: np.ndarray) -> Robot:
    """Return a robot whose loads are known by its values as they are fitted.

    It is the same one where its file states no masses or by which values loads are known, and where
    loads are a part of the model.

    Parameters
    ----------
    structure : Structure
    X : (N, n, b)
        Columns of the base parameters.
    y : (N, n) [N·m or N]
    data : (N, n) bool
        Where torque is data.
    """
    robot, base = structure.robot, structure.base
    loaded = any(e.name in FAMILIES and FAMILIES[e.name].loaded for e in structure.model.effects)
    if robot.reference or loaded or not has_masses(robot):
        return robot
    stated = structure.nominal_base
    squares, target, total = np.zeros((len(stated), len(stated))), np.zeros(len(stated)), 0.0
    for j, own in enumerate(data.T):
        A, torque = X[own, j], y[own, j]
        size = float(torque @ torque)
        if size > 0:
            R = triangular_factor(np.column_stack([A, torque - A @ stated]))
            rest = float(np.sum(R[len(stated) :, -1] ** 2))
            weight = len(torque) / max(rest, EXACT * size)
            squares += weight * R[:, :-1].T @ R[:, :-1]
            target += weight * R[:, :-1].T @ R[:, -1]
            total += weight * size
    stated_values = reference_values(robot)
    bodies = (f"{body}.{kind}" for body in robot.bodies for kind in INERTIAL_KINDS)
    values = {name: stated_values.get(name, 0.0) for name in bodies}
    masses = {body: abs(values[f"{body}.m"]) for body in robot.bodies}
    usual = sum(masses.values()) / len(masses)
    # Rotors and friction are as logs say, bodies as near to the file as they let them.
    whole = base.G.T @ squares @ base.G
    length = np.diag(whole)
    sd = np.sqrt(np.where(length > 0, total / np.where(length > 0, length, 1.0), 1.0))
    for k, p in enumerate(base.parameters):
        if p.owner in masses and p.kind in LOAD:
            sd[k] = SHARE * max(masses[p.owner], LEAST * usual) * LOAD[p.kind]
    unit = whole * np.outer(sd, sd) + np.eye(len(sd))
    change = sd * np.linalg.solve(unit, sd * (base.G.T @ target))
    for p, x in zip(base.parameters, change.tolist(), strict=True):
        values[p.name] = stated_values.get(p.name, 0.0) + x
    return replace(robot, reference=values)
