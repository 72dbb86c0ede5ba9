"""Kept values have errors: what these explain is no effect, what they do not is one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, Robot, analyze, diagnose
from identifiability.cli import app
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.completed import real_robot
from identifiability.workflows.diagnose.known_values import know_share, share_spread

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
        s = prepare_samples(robot, log, Preparation(keep_rest=True, decimate=1, cutoff=10.0))
        tau = np.array(log.tau)
        tau[s.motion.kept] += structure.model.regressor(robot, s.motion) @ added
        out.append(replace(log, tau=tau))
    return out


def off_by_a_tenth(name, seed):
    """What a tenth of every value as its standard deviation may add."""
    structure = Structure.of(Robot.load(name), Model.of(*EFFECTS))
    spread = share_spread(0.1, structure)
    drawn = spread * np.random.default_rng(seed).standard_normal(len(spread))
    return dict(zip(structure.columns, drawn, strict=True))


#: What looks like wrong masses and friction.
FEW = ("payload", "gravity_tilt", "torque_offset", "joint_stiffness", "coulomb_friction",
       "viscous_friction", "position_ripple")  # fmt: skip


@pytest.mark.parametrize(
    "effects", [FEW, pytest.param(None, marks=pytest.mark.everything)], ids=["few", "all"]
)
def test_errors_of_the_file_are_named_only_where_it_is_taken_as_exact(logs_of, effects):
    logs = moved(logs_of("two-link"), "two-link", off_by_a_tenth("two-link", 0))
    exact = quick("two-link", logs[:4], logs[4:], fixed=True, effects=effects)
    assert exact.effects
    assert any("taken as exact" in hint for hint in exact.hints)
    told = quick("two-link", logs[:4], logs[4:], fixed=0.1, effects=effects)
    assert told.effects == ()
    assert "each within 10 %," in told.statement
    assert not any("taken as exact" in hint for hint in told.hints)
    assert told.held_before < 0.5 * exact.held_before


def test_a_payload_beyond_the_errors_is_named_with_its_mass(logs_of):
    logs = moved(logs_of("six-dof-arm"), "six-dof-arm", {"link_6.m": 4.0})
    d = quick("six-dof-arm", logs[:4], logs[4:], fixed=0.05, effects=["payload"])
    (e,) = d.effects
    (mass,) = [r for p in e.placements for r in p.rows if r[0].endswith("payload_m")]
    assert abs(mass[1] - 4.0) < 3 * mass[2] < 1.5
    assert f"in link_6, {mass[1]:.3g} ± " in d.statement


def test_a_result_tells_its_values_and_their_covariance(logs_of, tmp_path):
    before, logs = logs_of("two-link", seed=5), logs_of("two-link", seed=6)
    a = analyze("two-link", before[:3], replicates=0)
    path = a.to_json(tmp_path / "before.json")
    d = quick("two-link", logs[:4], logs[4:], fixed=path)
    assert d.effects == ()
    assert d.known is not None
    sd = np.sqrt(np.diag(a.fit.base_covariance))  # a file keeps what σ makes matter
    assert np.all(np.abs(d.known.values - a.fit.base) <= 0.01 * sd)
    assert len(a.fit.names) < len(d.known.values)  # what a reduced model leaves out is not known
    np.testing.assert_array_equal(d.known.free, range(len(sd)))
    off = np.linalg.pinv(d.known.root.T @ d.known.root) - a.fit.base_covariance
    assert np.all(np.abs(off) <= 0.02 * np.outer(sd, sd))
    assert "the values of before.json, with their errors," in d.statement
    assert json.loads(json.dumps(d.to_dict()))["fixed"] is True
    # What is kept to predict with are these values, as far as they are known, and their covariance.
    assert np.all(np.abs(d.fit.base - d.known.values) <= 3.0 * sd)
    np.testing.assert_allclose(np.diag(d.fit.covariance), sd**2, rtol=0.02)
    with pytest.raises(IdentifiabilityError, match="give that model, or no model"):
        quick("two-link", logs, fixed=path, model=["rigid_body"])


def test_shares_are_of_masses_of_moments_and_of_inertia_as_long():
    structure = Structure.of(Robot.load("six-dof-arm"), Model.of(*EFFECTS))
    nominal = dict(zip(structure.columns, structure.nominal, strict=True))
    spread = dict(zip(structure.columns, share_spread(0.2, structure), strict=True))
    assert spread["link_3.m"] == pytest.approx(0.2 * nominal["link_3.m"])
    first = [nominal[f"link_3.{k}"] for k in ("mx", "my", "mz")]
    for kind in ("mx", "my", "mz"):
        assert spread[f"link_3.{kind}"] == pytest.approx(0.2 * np.linalg.norm(first))
    assert spread["joint_2.Fv"] == pytest.approx(0.2 * nominal["joint_2.Fv"])
    known = know_share(0.2, structure)
    np.testing.assert_allclose(known.values, structure.nominal_base)
    wide = structure.G[known.free] * share_spread(0.2, structure)
    inside = known.root @ wide
    np.testing.assert_allclose(inside @ inside.T, np.eye(len(inside)), atol=1e-6)
    with pytest.raises(IdentifiabilityError, match="a share above 0"):
        know_share(0.0, structure)


def test_values_are_kept_in_one_way_at_a_time(tmp_path):
    log = tmp_path / "log.csv"
    names = [f"{joint}.{kind}" for joint in ("shoulder", "elbow") for kind in ("q", "tau")]
    rows = [f"{0.01 * k},1,2,3,{k}" for k in range(60)]
    log.write_text("\n".join([",".join(["t", *names]), *rows]))
    argv = ["diagnose", "two-link", str(log), "--fixed", "--fixed-share", "0.1"]
    out = CliRunner().invoke(app, argv)
    assert out.exit_code == 2
    assert "one way at a time" in " ".join(out.output.split())


def test_a_simulation_forward_begins_with_the_values_of_the_result(logs_of):
    """The robot is far from its file: kept values of a result simulate it, the file's do not."""
    far = {"link1.m": 1.0, "link2.m": 0.8, "link2.mx": 0.2, "elbow.Fc": 0.3}
    before = moved(logs_of("two-link", seed=5), "two-link", far)
    hidden = logs_of("two-link", "joint_stiffness@shoulder=0.05", seed=6)
    logs = moved(hidden, "two-link", far)
    a = analyze("two-link", before[:3], replicates=0)
    few = {"effects": ["joint_stiffness"]}
    d = diagnose("two-link", logs[:4], logs[4:], fixed=a, **few)
    assert [(e.name, e.joints) for e in d.effects] == [("joint_stiffness", ("shoulder",))]
    kept = real_robot(d, d.structure)
    base = d.structure.G @ [kept.values[name] for name in d.structure.columns]
    sd = np.sqrt(np.diag(a.fit.base_covariance))
    assert np.abs((base - a.fit.base) / sd).max() < 3.0
    assert d.forward.error_after < d.forward.error_before < 0.3
    added = dict(
        x for p in d.effects[0].placements for x in zip(p.parameters, p.fitted, strict=True)
    )
    both = real_robot(d, d.completed).values
    assert both == pytest.approx({n: kept.values.get(n, 0.0) + added.get(n, 0.0) for n in both})
