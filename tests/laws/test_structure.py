"""A `Structure` owns what follows from a robot under a model, and nobody else derives it."""

import numpy as np
import pytest

from identifiability.foundation.names import GROUPED_KINDS
from identifiability.physical.fitted_model import physical_set
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters
from identifiability.robot import Robot


@pytest.fixture(scope="module")
def two_link():
    return Robot.load("two-link")


@pytest.fixture(scope="module")
def structure(two_link):
    return Structure.of(two_link, Model.of("rigid_body", "viscous_friction", "payload"))


def test_values_signs_and_bodies_are_those_of_the_robot_file(structure, two_link):
    base = find_base_parameters(two_link, structure.model)
    np.testing.assert_array_equal(structure.G, base.G)
    for k, parameter in enumerate(base.parameters):
        assert structure.columns[k] == parameter.name
        assert structure.nominal[k] == two_link.nominal.get(parameter.name, 0.0)
        assert structure.nonnegative[k] == parameter.nonnegative
    for row, value in enumerate(structure.nominal_base):
        stated = sum(c * two_link.nominal.get(p.name, 0.0) for c, p in base.terms(row))
        assert value == pytest.approx(stated, rel=1e-12, abs=1e-15)


def test_the_ten_columns_of_every_body_and_load_are_found_by_name(structure, two_link):
    last = two_link.bodies[-1]
    assert list(structure.bodies) == [*(f"{b}." for b in two_link.bodies), f"{last}.payload_"]
    for stem, columns in zip(structure.bodies, structure.inertial, strict=True):
        assert [structure.columns[k] for k in columns] == [
            f"{stem}{kind}" for kind in GROUPED_KINDS
        ]


def test_what_follows_is_derived_once_and_cannot_be_written_to(structure):
    assert physical_set(structure) is physical_set(structure)
    for name in ("nominal", "nominal_base", "nonnegative", "inertial"):
        found = getattr(structure, name)
        assert found is getattr(structure, name)
        with pytest.raises(ValueError, match="read-only"):
            found[...] = 0
