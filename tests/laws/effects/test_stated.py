"""What effects state of parameters holds everywhere: their sign, and where a file has them."""

import numpy as np
import pytest

from identifiability import Log, Model, Robot, analyze, prune
from identifiability.effects import FAMILIES, AlongAxes, Family, forget, register
from identifiability.effects.vocabulary import stated_numbers, values_in_file
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.physical.fitted_model import physical_set
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import Structure
from identifiability.robot.description import name_numbers
from identifiability.workflows.export import write_parameters
from identifiability.workflows.export.workflow import state_lost

from ...conftest import shipped_log
from .conftest import move

#: All that the simulated arm has, and the drag: nothing is missing beside them.
EFFECTS = ("rigid_body", "actuator_inertia", "viscous_friction", "coulomb_friction", "cubic_drag")
LADDER = f"""
[[models]]
name = "with drag"
effects = {list(EFFECTS)}
"""


class Cubic(AlongAxes):
    """A study's own drag, with the third power of speed."""

    name = "cubic_drag"
    equation = "τ = Fz q̇³"
    units = (("Fz", "N·m·s³/rad³", "N·s³/m³"),)
    nonnegative = True

    def curves(self, at):
        return [at.speed**3]


class Either(Cubic):
    """The same without a sign."""

    nonnegative = False


@pytest.fixture(params=[Cubic, Either])
def drag(request):
    register(Family(request.param(), "cubic drag"))
    yield request.param
    forget("cubic_drag")


@pytest.fixture(scope="module")
def pushed(two_link):
    """A log of the two-link arm whose elbow is driven by what brakes its shoulder."""
    log = shipped_log(two_link, "a", 300)
    tau = log.tau.copy()
    tau += [0.05, -0.05] * log.dq**3
    tau += 1e-3 * np.random.default_rng(0).normal(size=tau.shape)
    return Log("pushed", log.joints, log.t, log.q, tau, log.dq, log.ddq, "")


def test_a_sign_of_the_users_own_binds_every_stage(drag, two):
    structure = Structure.of(two, Model.of(*EFFECTS))
    at = structure.columns.index("elbow.Fz")
    signed = drag is Cubic
    assert structure.nonnegative[at] == signed
    assert structure.base.nonnegative[structure.base.names.index("elbow.Fz")] == signed
    assert physical_set(structure).nonnegative[at] == signed
    m = move(two, 0.01 * np.arange(50))
    candidates, _ = list_candidates(two, (FAMILIES["cubic_drag"],), (), [m], fixed=False)
    assert {c.positive for c in candidates} == {signed}


def test_a_forbidden_level_is_told_by_analyze_and_prune_and_no_real_robot_has_it(
    drag, pushed, tmp_path
):
    ladder = tmp_path / "ladder.toml"
    ladder.write_text(LADDER)
    found = analyze("two-link", pushed, ladder=ladder, replicates=0)
    assert found.missing.functions == ()
    level = next(r["value"] for r in found.chosen.rows() if r["name"] == "elbow.Fz")
    assert level == pytest.approx(-0.05, abs=0.002)
    nearest = found.chosen.physical.parameters()["elbow.Fz"]
    if drag is Either:
        assert nearest == pytest.approx(level, rel=0.1)
        assert "elbow.Fz" not in found.chosen.infeasible
    else:
        assert nearest == pytest.approx(0.0, abs=1e-6)
        assert "elbow.Fz" in found.chosen.infeasible
    pruned = prune("two-link", pushed, ladder=ladder, replicates=0)
    forbidden = {n for n in pruned.models[0].infeasible if n.endswith(".Fz")}
    assert forbidden == (set() if drag is Either else {"elbow.Fz"})


def test_every_part_of_a_rotor_has_a_sign_whatever_it_is_called(tmp_path):
    side = tmp_path / "parts.toml"
    side.write_text('inertia_parts = ["rotor", "screw"]')
    structure = Structure.of(Robot.load("two-link", side), Model.of("actuator_inertia"))
    assert structure.columns[:2] == ("shoulder.rotor", "shoulder.screw")
    assert structure.nonnegative.all()


def test_what_a_file_states_of_a_parameter_is_read_as_that_parameter(robot):
    """Written by what effects say, read by what the robot says: the same number."""
    for family in FAMILIES.values():
        for p in family.effect.parameters(robot):
            if p.stated_as in ("", *INERTIAL_KINDS) or p.owner not in robot.dofs:
                continue
            numbers = stated_numbers(robot, {p.name: 3.0})[p.owner]
            read = name_numbers(p.owner, numbers, robot.inertia_parts)
            held = values_in_file(robot, {p.name: 3.0})[p.name]
            assert held == (3.0 if p.stated_as in numbers else 0.0)
            first = f"{p.owner}.{robot.inertia_parts[0]}"  # it has a rotor's sum
            name = f"{p.owner}.Fc" if family.name == "hysteresis" else p.name  # beyond its ways
            assert read.get(first if p.stated_as == "armature" else name, 0.0) == held


def test_an_mjcf_has_friction_of_coupled_motors_also_where_a_level_adds_to_it(tmp_path):
    side = tmp_path / "coupled.toml"
    side.write_text('[transmission]\nmotors = ["a", "b"]\ncoupling = [[1, 0], [1, 1]]\n')
    robot = Robot.load("two-link", side)
    values = {"b.Fc": 3.0, "b.H1": 1.0}
    written = write_parameters(robot, values, tmp_path / "new.xml", shapes={"b.hysteresis": 0.1})
    assert values_in_file(robot, values, "mjcf") == values
    assert written.beside == ("b.H1",)


def test_a_fault_of_a_sensor_is_none_of_the_file(two_link):
    values = {"elbow.scale": 0.3, "elbow.Fs": 1.0, "elbow.Fc": 2.0}
    lacking = {"a": ("elbow.scale",), "b": ("elbow.Fs",)}
    said = state_lost(two_link, values, lacking, "mjcf", "file")
    assert "leaves out a (elbow.scale)" in said
    assert "cannot hold b (elbow.Fs)" in said
