"""What is at the edge of the possible up to rounding is possible."""

from dataclasses import replace

import pytest

from identifiability import analyze
from identifiability.physical.feasibility import certify_model
from identifiability.physical.fitted_model import FittedModel

from ..conftest import shipped_log


@pytest.fixture(scope="module")
def arm(two_link):
    """A two-link arm whose elbow has no rotor."""
    return replace(two_link, nominal=dict(two_link.nominal) | {"elbow.Ia": 0.0})


@pytest.fixture(scope="module")
def exact(arm):
    log = shipped_log(arm, "a", 400, noise="none", derivatives=True)
    return analyze(arm, log, replicates=0)


@pytest.mark.parametrize("rotor, possible", [(-1e-14, True), (-1e-3, False)])
def test_a_rotor_that_is_zero_up_to_rounding_is_possible(exact, rotor, possible):
    model = exact.models[0]
    at = model.submodel.columns.index("elbow.Ia")
    value = model.estimate.value.copy()
    assert abs(value[at]) < 1e-9
    value[at] = rotor
    fit = replace(model.estimate, value=value)
    reduced = model.submodel.reduce(exact.information)
    fitted = FittedModel(exact.structure, model.submodel, exact.information, reduced, fit)
    certificate, said = certify_model(fitted)
    assert certificate.feasible is possible, said
