"""What the joints of a robot suggest about its bodies."""

import pytest

from identifiability import Model, Robot
from identifiability.regression.structure import Structure
from identifiability.workflows.prune.moves import Kind, propose_moves, tie_moves


@pytest.fixture(scope="module")
def moves():
    robot = Robot.load("3-rps")
    effects = ("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia")
    structure = Structure.of(robot, Model.of(*effects))
    return robot, structure, [*propose_moves(structure, structure.base.names)]


def test_the_papers_geometry_is_proposed_from_the_joints_alone(moves):
    """Rows 1, 4, 14, 18, 20, 24 and 7, 8, 10, 13 of Table 1."""
    zeroed = {c for m in moves[2] if m.kind is Kind.ZERO for c in m.zero}
    legs = {f"leg{k}_{part}.mx" for k in (1, 2, 3) for part in ("lower", "upper")}
    assert zeroed == legs | {"platform.Ixy", "platform.Ixz", "platform.Iyz", "platform.mz"}


def test_the_papers_equal_legs_are_proposed_from_the_joints_alone(moves):
    structure = moves[1]
    ties = {frozenset(m.tie[0]) for m in tie_moves(structure, structure.base.names)}
    for kind in ("lower.my", "upper.Iyy", "upper.mz"):
        assert frozenset(f"leg{k}_{kind}" for k in (1, 2, 3)) in ties
    assert len([m for m in moves[2] if "declares" in m.why]) == 3


def test_friction_and_actuators_are_never_tied(moves):
    tied = {c for m in moves[2] if m.kind is Kind.TIE for s in m.tie for c in s}
    assert not any(c.startswith("slider") for c in tied)
