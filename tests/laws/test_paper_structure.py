"""How many base parameters there are; Table 1 itself is a study, which the tests run."""

import tomllib
from pathlib import Path

import pytest

from identifiability import Model, find_base_parameters

from ..conftest import load

REFERENCE = Path(__file__).parent.parent / "models_reference/base_parameter_counts.toml"


def test_actuator_inertia_is_one_of_two_parameters_and_friction_is_all(rps, paper_model):
    labels = find_base_parameters(rps, paper_model).labels
    assert [x for x in labels if "Jr" in x] == [f"Jr({k}) + Js({k})" for k in (1, 2, 3)]
    friction = [x for x in labels if x.startswith("F")]
    assert len(friction) == 9
    assert not any("+ " in x.replace("Fc+", "") for x in friction)


COUNTS = tomllib.loads(REFERENCE.read_text())


@pytest.mark.parametrize("name", [x for x in COUNTS if "closed_form" in COUNTS[x]])
def test_base_parameters_are_as_many_as_energy_and_thought_say(name):
    """Counts by the energy of the bodies and by closed forms; sources in the reference file."""
    base = find_base_parameters(load(name), Model.of("rigid_body"))
    assert base.rank == COUNTS[name]["count"]
    last, dropped = base.gap
    assert last / max(dropped, 1e-300) > 1e6
