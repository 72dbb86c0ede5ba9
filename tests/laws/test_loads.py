"""Loads by fitted values: of the torque that the model has, whatever the file says."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects.measurement import nominal_torque
from identifiability.estimation.groups import fit_loads
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.simulation import random_trajectory


def motion_of(robot, seed):
    trajectory = random_trajectory(robot, np.random.default_rng(seed), samples=400)
    t = trajectory.times(400)
    return complete_motion(robot, t, *trajectory.motion(t))


def torque_of(structure, motion, base):
    return structure.model.regressor(structure.robot, motion)[:, :, structure.base.kept] @ base


@pytest.mark.parametrize("name", ["two-link", "six-dof-arm", "five-bar"])
def test_loads_are_the_torque_of_a_machine_that_differs_from_its_file(name):
    """Bodies a fifth off, rotors and friction that no file states; on motion that is new, too."""
    robot, rng = Robot.load(name), np.random.default_rng(0)
    structure = Structure.of(robot, Model.of(*USUAL_EFFECTS))
    standard = structure.nominal * rng.uniform(0.8, 1.2, len(structure.nominal))
    standard += [0.1 if p.kind in ("Fc", "Fv", "Ia") else 0.0 for p in structure.parameters]
    seen, new = motion_of(robot, 1), motion_of(robot, 2)
    y = torque_of(structure, seen, structure.G @ standard)
    X = structure.model.regressor(robot, seen)[:, :, structure.base.kept]
    fitted = fit_loads(structure, X, y, np.ones(y.shape, bool))
    for motion in (seen, new):
        true = torque_of(structure, motion, structure.G @ standard)
        errors = [np.linalg.norm(nominal_torque(r, motion) - true) for r in (fitted, robot)]
        assert errors[0] < 0.01 * np.linalg.norm(true) < errors[1]


def test_where_logs_say_nothing_or_loads_are_known_the_file_stays():
    robot = Robot.load("two-link")
    structure = Structure.of(robot, Model.of(*USUAL_EFFECTS))
    X = structure.model.regressor(robot, motion_of(robot, 1))[:, :, structure.base.kept]
    y, none = X @ structure.nominal_base, np.zeros((len(X), 2), bool)
    for data in (none, ~none):
        same = fit_loads(structure, X, y, data).reference
        assert same == pytest.approx(fit_loads(structure, X, y, none).reference, abs=1e-9)
    stated = replace(structure, robot=replace(robot, reference={"link1.m": 1.0}))
    assert fit_loads(stated, X, 2 * y, ~none) is stated.robot
    loaded = Structure.of(robot, Model.of(*USUAL_EFFECTS, "load_dependent_friction"))
    assert fit_loads(loaded, X, y, ~none) is loaded.robot
