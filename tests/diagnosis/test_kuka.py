"""A real arm: from rigid-body dynamics alone the friction that every joint has is named."""

import importlib
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture(scope="module")
def study():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("hidden_effect_kuka")
    sys.path.remove(str(STUDIES))


@pytest.fixture(scope="module")
def data(study):
    shared = importlib.import_module("real_data.study")
    folder = shared.data_folder("kuka_lwr4")
    if not folder.is_dir():
        pytest.skip(f"no data in {folder}; set {shared.VARIABLE}")
    return folder


FOUND = {"coulomb_friction", "torque_offset"}
MISTAKEN = {"stribeck_friction", "quadratic_friction", "load_dependent_friction", "joint_stiffness"}


@pytest.mark.parametrize(
    ("train", "test", "effects", "shrink"),
    [
        (1, 3, sorted(FOUND | MISTAKEN | {"viscous_friction"}), 0.5),
        pytest.param(
            1, 3, None, 0.5,
            marks=[
                pytest.mark.everything,
                pytest.mark.xfail(
                    strict=True, reason="among all effects run 3 refutes the offset in joint 0"
                ),
            ],
        ),
        pytest.param(3, 1, None, 0.8, marks=pytest.mark.everything),
    ],
)  # fmt: skip
def test_friction_and_offset_are_named_and_the_classic_mistakes_are_not(
    study, data, train, test, effects, shrink
):
    d = study.run(data, [train], [test], effects=effects)
    names = {e.name for e in d.effects}
    assert names >= FOUND
    assert not names & MISTAKEN
    # Quarters of the held-out run chose; the others verify.
    assert d.verified_on == f"quarters 2 and 4 of run {test}"
    assert d.held_after < shrink * d.held_before
    assert d.interval[1] < 0
    assert d.real_after < d.real_before < d.held_before
