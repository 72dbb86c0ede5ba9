"""A robot file written with other parameters gives these parameters on both roads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import IdentifiabilityError, Model, Robot, simulate
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.regression.structure import random_motion
from identifiability.simulation import PrescribedMotion
from identifiability.workflows.export import write_parameters


def other_parameters(robot, rng):
    """Every body made heavier by a random solid, every joint parameter changed."""
    values = dict(robot.nominal)
    for body in robot.bodies:
        mass, centre = rng.uniform(0.1, 1), rng.uniform(-0.1, 0.1, 3)
        root = 0.05 * rng.normal(size=(3, 3))
        second = root @ root.T + mass * np.outer(centre, centre)
        inertia = np.trace(second) * np.eye(3) - second
        added = [mass, *(mass * centre), inertia[0, 0], inertia[0, 1], inertia[1, 1],
                 inertia[0, 2], inertia[1, 2], inertia[2, 2]]  # fmt: skip
        for kind, value in zip(INERTIAL_KINDS, added, strict=True):
            values[f"{body}.{kind}"] += value
    for name in robot.joints:
        values[f"{name}.Fv"] += rng.uniform(0.1, 1)
        level = values[f"{name}.Fc"] + rng.uniform(0.1, 1)
        values |= {f"{name}.{k}": level for k in ("Fc", "Fc+", "Fc-")}
        values[f"{name}.{robot.inertia_parts[0]}"] += rng.uniform(0.1, 1)
    return values


def test_written_robots_give_the_written_parameters_on_both_roads(robot, tmp_path):
    rng = np.random.default_rng(0)
    values = other_parameters(robot, rng)
    path = tmp_path / f"copy{robot.path.suffix}"
    written = write_parameters(robot, values, path)
    rotors = () if robot.mjcf else tuple(f"{joint}.Ia" for joint in robot.joints)
    assert written.beside == rotors
    copy = Robot.load(path)
    for name, value in values.items():
        assert copy.nominal[name] == pytest.approx(value, rel=1e-12, abs=1e-12), name
    model = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
    motion = random_motion(robot, rng, 20)
    phi = np.array([values[p.name] for p in model.parameters(robot)])
    fitted = model.regressor(robot, motion) @ phi
    move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
    simulated = simulate(copy, move).tau  # MuJoCo reads the written file by itself
    assert_allclose(simulated, fitted, atol=1e-9 * np.abs(fitted).max())


def test_only_the_numbers_that_changed_are_written_anew(rps, tmp_path):
    """Comments, order and indentation of the user's file stay: one tag differs."""
    name = rps.path.name
    own = rps.path.read_text().splitlines()
    changed = {"leg1_lower.Izz": 0.99 * rps.nominal["leg1_lower.Izz"]}
    rps.with_values(changed).save(tmp_path / name)
    assert rps.path.read_text().splitlines() == own
    new = (tmp_path / name).read_text().splitlines()
    assert len(new) == len(own)
    differ = [k for k, lines in enumerate(zip(own, new, strict=True)) if lines[0] != lines[1]]
    assert 1 <= len(differ) <= 2
    assert all("<inertial" in new[k] for k in differ)


def test_a_body_without_mass_is_refused_by_name(rps, tmp_path):
    with pytest.raises(IdentifiabilityError, match="'platform' has a mass of -1 kg"):
        write_parameters(rps, {"platform.m": -1.0}, tmp_path / "copy.xml")
    assert not (tmp_path / "copy.xml").exists()


def test_what_a_robot_file_cannot_hold_stands_in_the_sidecar_and_is_listed(rps, tmp_path):
    values = {"slider2.Fs": 4.0, "slider3.Fq": 0.01}
    shapes = {"slider2.stribeck_friction": 0.02}
    written = write_parameters(
        rps, values, tmp_path / "copy.xml", shapes=shapes, reference={"platform.m": 7.0}
    )
    assert set(written.beside) == set(values)
    copy = Robot.load(tmp_path / "copy.xml")
    assert {name: copy.nominal[name] for name in values} == values
    assert copy.shapes == shapes
    assert copy.reference == {"platform.m": 7.0}
    again = write_parameters(copy, {}, tmp_path / "again.xml", shapes={}, reference={})
    assert Robot.load(tmp_path / "again.xml").nominal["slider2.Fs"] == 4.0
    assert not Robot.load(tmp_path / "again.xml").shapes
    assert set(again.beside) == set(values)
