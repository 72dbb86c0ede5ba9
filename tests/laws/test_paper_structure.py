"""How many base parameters there are; Table 1 itself is a study, which the tests run."""

import tomllib
from pathlib import Path

import pytest

from identifiability import Model, find_base_parameters

from ..conftest import load
from ..models_reference.energy_rank import energy_rank

REFERENCE = Path(__file__).parent.parent / "models_reference" / "base_parameter_counts.toml"


def test_actuator_inertia_is_one_of_two_parameters_and_friction_is_all(rps, paper_model):
    labels = find_base_parameters(rps, paper_model).labels
    assert [x for x in labels if "Jr" in x] == [f"Jr({k}) + Js({k})" for k in (1, 2, 3)]
    friction = [x for x in labels if x.startswith("F")]
    assert len(friction) == 9
    assert not any("+ " in x.replace("Fc+", "") for x in friction)


#: Robots of hinges and slides alone, whose energy is quick to write down.
COUNTED = ("two-link", "five-bar", "six-dof-arm", "delta", "3-rrr", "palletizer", "six-actuators",
           "scara", "differential-wrist")  # fmt: skip


@pytest.mark.parametrize("name", [*COUNTED, "six-ups", "3-rps"])
def test_base_parameters_are_as_many_as_energy_and_thought_say(name):
    """Counts by the energy of the bodies and by closed forms; sources in the reference file."""
    robot, wanted = load(name), tomllib.loads(REFERENCE.read_text())[name]["count"]
    base = find_base_parameters(robot, Model.of("rigid_body"))
    assert base.rank == wanted
    last, dropped = base.gap
    assert last / max(dropped, 1e-300) > 1e6
    if name in COUNTED:
        rank, gap = energy_rank(robot.path, samples=400)
        assert rank == wanted
        assert gap > 1e6
