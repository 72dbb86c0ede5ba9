"""Kept values have errors: what these explain is no effect, what they do not is one."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import (
    IdentifiabilityError,
    Model,
    Preparation,
    Robot,
    analyze,
    diagnose,
    prepare_log,
)
from identifiability.regression.structure import Structure

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def quick(*args, **options):
    return diagnose(*args, quick=True, forward=False, **options)


def moved(logs, name, phi):
    """Logs of a robot with other values: phi, by name, is added to those of the file."""
    robot = Robot.load(name)
    structure = Structure.of(robot, Model.of(*EFFECTS))
    added = np.array([phi.get(n, 0.0) for n in structure.columns])
    out = []
    for log in logs:
        s = prepare_log(robot, log, Preparation(keep_rest=True, decimate=1, cutoff=10.0))
        tau = np.array(log.tau)
        tau[s.motion.kept] += structure.model.regressor(robot, s.motion) @ added
        out.append(replace(log, tau=tau))
    return out


def off_by_a_tenth():
    """What a tenth may add: bodies as a whole, friction and rotors one by one."""
    structure = Structure.of(Robot.load("two-link"), Model.of(*EFFECTS))
    rng = np.random.default_rng(0)
    each = {p.owner: 0.1 * rng.standard_normal() for p in structure.parameters}
    share = [
        each[p.owner] if p.group == "rigid_body" else 0.1 * rng.standard_normal()
        for p in structure.parameters
    ]
    return dict(zip(structure.columns, share * structure.nominal, strict=True))


#: What looks like wrong masses and friction.
FEW = ("payload", "gravity_tilt", "torque_offset", "joint_stiffness", "coulomb_friction",
       "viscous_friction", "position_ripple")  # fmt: skip


@pytest.mark.parametrize("effects", [FEW, pytest.param(None, marks=pytest.mark.everything)])
def test_errors_of_the_file_are_named_only_where_it_is_taken_as_exact(logs_of, effects):
    logs = moved(logs_of("two-link"), "two-link", off_by_a_tenth())
    given = logs[:4], logs[4:]
    exact = quick("two-link", *given, fixed=True, effects=effects)
    assert exact.effects
    assert any("taken as exact" in hint for hint in exact.hints)
    told = quick("two-link", *given, fixed=0.1, effects=effects)
    assert told.effects == ()
    assert "each within 10 %" in told.details
    assert not any("taken as exact" in hint for hint in told.hints)
    assert told.held_before < 0.5 * exact.held_before
    bodies = {n: x for n, x in told.robot.nominal.items() if n[-2:] not in ("Fc", "Fv", "Ia")}
    bare = replace(told.robot, nominal=bodies)  # what no file states is free
    assert quick(bare, *given, fixed=0.1, effects=effects).effects == ()


def test_a_payload_beyond_the_errors_is_named_with_its_mass(logs_of):
    logs = moved(logs_of("six-dof-arm"), "six-dof-arm", {"link_6.m": 4.0})
    d = quick("six-dof-arm", logs[:4], logs[4:], fixed=0.05, effects=["payload"])
    (e,) = d.effects
    (mass,) = [r for p in e.placements for r in p.rows if r[0].endswith("payload_m")]
    assert abs(mass[1] - 4.0) < 3 * mass[2] < 1.5
    assert f"in link_6, {mass[1]:.2g} kg ± " in d.details


def test_a_result_tells_its_values_and_their_covariance(logs_of, tmp_path):
    before = logs_of("two-link", seed=5)
    logs = logs_of("two-link", seed=6)
    a = analyze("two-link", before[:3], replicates=0)
    path = a.to_json(tmp_path / "before.json")
    d = quick("two-link", logs[:4], logs[4:], fixed=path)
    assert d.effects == ()
    sd = np.sqrt(np.diag(a.fit.base_covariance))  # a file keeps what σ makes matter
    assert np.all(np.abs(d.known.base - a.fit.base) <= 0.01 * sd)
    assert len(a.fit.names) < len(d.known.base)  # what a reduced model leaves out is not known
    known = d.known.directions[:, d.known.precision > 0]
    off = known @ known.T - a.fit.base_covariance
    assert np.all(np.abs(off) <= 0.02 * np.outer(sd, sd))
    assert "the values of before.json, with their errors" in d.details
    assert d.to_dict()["fixed"]
    # What is kept to predict with are these values, as far as they are known.
    assert np.all(np.abs(d.fit.base - d.known.base) <= 3.0 * sd)
    with pytest.raises(IdentifiabilityError, match="give that model, or no model"):
        quick("two-link", logs, fixed=path, model=["rigid_body"])
