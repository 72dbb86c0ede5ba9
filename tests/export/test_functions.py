"""Functions that were learned are told, and exported, beside what the model does without them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model, Noise, analyze, prepare_log
from identifiability.regression.reduction import (
    LadderEntry,
    ModelEntry,
    leave_to_terms,
    list_functions,
)
from identifiability.regression.structure import Structure

from ..conftest import shipped_log

USUAL = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
#: The elbow reaches 4.4 rad/s: in the second nothing is said of most of the splines.
FUNCTIONS = ("function_of_velocity@elbow", "function_of_velocity@elbow:40")


def make_log(robot):
    hidden = ["stribeck_friction@elbow=0.1"]
    return shipped_log(robot, "a", 400, noise=Noise(torque=0.02), hide=hidden)


@pytest.fixture(scope="module", params=FUNCTIONS)
def learned(request, tmp_path_factory, two_link):
    ladder = LadderEntry(models=[ModelEntry(name="learned", effects=[*USUAL, request.param])])
    result = analyze(two_link, make_log(two_link), ladder=ladder, replicates=0)
    return result, result.to_json(tmp_path_factory.mktemp("learned") / "result.json")


def test_a_file_holds_what_is_best_without_the_function(learned):
    """The friction of the file is that of a model without the function, at every range of it.

    A table states it beside the splines, whose columns its label names.
    """
    result, _ = learned
    plain = analyze("two-link", make_log(result.robot), ladder=LadderEntry(
        models=[ModelEntry(name="plain", effects=list(USUAL))]), replicates=0)  # fmt: skip
    values, simple = (r.chosen.physical.parameters() for r in (result, plain))
    for name in ("elbow.Fv", "elbow.Fc"):
        assert values[name] == pytest.approx(simple[name], rel=0.05)
        assert "fo" in result.to_frame(details=True).set_index("name").loc[name, "label"]
    curve = [x for n, x in values.items() if ".fo" in n or ".fe" in n]
    assert np.abs(curve).max() < 3 * np.abs(result.samples[0].tau[:, 1]).max()


def test_no_term_gets_a_sign_that_physics_forbids(two_link):
    structure = Structure.of(two_link, Model.of(*USUAL, FUNCTIONS[0]))
    W = structure.model.regressor(two_link, prepare_log(two_link, make_log(two_link)).motion)
    R = W.reshape(-1, W.shape[2])
    phi = np.zeros(W.shape[2])
    (own,) = list_functions(structure)
    phi[own] = np.linspace(-3, 3, len(own))  # pushes on
    found = leave_to_terms(structure, R, phi)
    assert (found[structure.nonnegative] >= 0).all()
    assert_allclose(R @ found, R @ phi, atol=1e-9)
