"""What the paper says exactly: Table 1, ranks, model sizes, CAD identities, exact recovery."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.logs.prepare import prepare_log
from identifiability.regression.information import gather_information
from identifiability.regression.reduction import build_ladder, read_ladder
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, find_base_parameters

from ..conftest import load
from ..models_reference.energy_rank import energy_rank

#: Table 1: row -> (name of the representative, coefficients), digits as printed.
TABLE_1 = {
    1: {"mx(1)": 1},
    2: {"my(1)": 1},
    3: {"Izz(1)": 1, "Iyy(2)": 1},
    4: {"mx(2)": 1},
    5: {"mz(2)": 1},
    6: {"Ixx(3)": 1, "my(3)": -0.3952},
    7: {"Ixy(3)": 1, "my(3)": 0.2282},
    8: {"Ixz(3)": 1},
    9: {"Iyy(3)": 1, "my(3)": 0.3952, "m(3)": -0.2082, "m(2)": -0.2082},
    10: {"Iyz(3)": 1},
    11: {"Izz(3)": 1, "m(3)": -0.2082, "m(2)": -0.2082},
    12: {"mx(3)": 1, "my(3)": 0.5774, "m(3)": -0.4563, "m(2)": -0.4563},
    13: {"mz(3)": 1},
    14: {"mx(4)": 1},
    15: {"my(4)": 1},
    16: {"Iyy(5)": 1, "Izz(4)": 1},
    17: {"m(5)": 1, "my(3)": -2.531, "m(3)": 1, "m(2)": 1},
    18: {"mx(5)": 1},
    19: {"mz(5)": 1},
    20: {"mx(6)": 1},
    21: {"my(6)": 1},
    22: {"Iyy(7)": 1, "Izz(6)": 1},
    23: {"m(7)": 1, "my(3)": 2.531},
    24: {"mx(7)": 1},
    25: {"mz(7)": 1},
}

REFERENCE = Path(__file__).parent.parent / "models_reference" / "base_parameter_counts.toml"


@pytest.fixture
def structure(rps, paper_model):
    return Structure.of(rps, paper_model)


@pytest.fixture
def base(structure):
    return structure.base


@pytest.fixture
def submodels(structure):
    return build_ladder(read_ladder(structure.robot.path.with_name("ladder.toml")), structure)


def digits(value):
    """Round as the paper prints: four significant digits, or four decimals below one."""
    return float(f"{value:.4g}")


def test_the_rigid_body_has_25_base_parameters_and_the_full_model_37_of_85(rps, base):
    rigid = find_base_parameters(rps, Model.of("rigid_body"))
    assert (len(rigid.parameters), rigid.rank) == (70, 25)
    assert (len(base.parameters), base.rank) == (85, 37)
    for found, kept in ((rigid, 5e-3), (base, 3e-4)):
        last, first_dropped = found.gap
        assert last > kept
        assert first_dropped < 1e-13
        assert not found.ambiguous


def test_every_grouping_and_coefficient_of_table_1_comes_from_the_robot_file(rps):
    base = find_base_parameters(rps, Model.of("rigid_body"))
    found = [{p.term: digits(c) for c, p in base.terms(row)} for row in range(len(base))]
    for row, wanted in TABLE_1.items():
        assert wanted in found, f"row {row}: {wanted} is not among {found}"
    assert len(found) == 25


def test_actuator_inertia_is_one_of_two_parameters_and_friction_is_all(base):
    labels = base.labels
    assert [x for x in labels if "Jr" in x] == [f"Jr({k}) + Js({k})" for k in (1, 2, 3)]
    friction = [x for x in labels if x.startswith("F")]
    assert len(friction) == 9
    assert not any("+ " in x.replace("Fc+", "") for x in friction)


def test_models_1_to_4_have_37_24_18_and_12_parameters(submodels):
    assert [len(r) for r in submodels] == [37, 24, 18, 12]


def test_model_4_keeps_rows_12_17_and_23(submodels):
    rigid = [lab for lab in submodels[3].labels if "m" in lab.split("(")[0]]
    assert len(rigid) == 3
    assert any(lab.startswith("mx(3)") for lab in rigid)
    assert any(lab.startswith("m(5)") for lab in rigid)
    assert any(lab.startswith("m(7)") for lab in rigid)


def test_the_cad_identities_of_table_8_hold(rps, structure):
    value = dict(zip(structure.base.names, structure.nominal_base, strict=True))
    assert value["platform.mx"] == pytest.approx(-2.47, abs=0.005)
    assert value["leg2_upper.m"] == pytest.approx(10.83, abs=0.005)
    assert value["leg3_upper.m"] == pytest.approx(5.42, abs=0.005)
    # With a centred platform: P12 = -h (m2 + m3/3), P17 = m5 + m2 + 2 m3/3, P23 = m7 + m3/3.
    m2, m3 = rps.nominal["leg1_upper.m"], rps.nominal["platform.m"]
    assert value["platform.mx"] == pytest.approx(-0.4563 * (m2 + m3 / 3), rel=1e-6)
    assert value["leg2_upper.m"] == pytest.approx(2 * m2 + 2 * m3 / 3, rel=1e-6)
    assert value["leg3_upper.m"] == pytest.approx(m2 + m3 / 3, rel=1e-6)


def test_models_1_to_3_recover_noise_free_parameters_exactly(rps, structure, submodels, exact_log):
    information = gather_information(structure.regression([prepare_log(rps, exact_log)]))
    truth = structure.nominal_base
    for submodel in submodels[:3]:
        fit = estimate(submodel.reduce(information), "ols")
        error = np.abs(submodel.expand(fit.value) - truth)
        assert error.max() < 1e-9 * np.abs(truth).max(), submodel.name
    truncated = estimate(submodels[3].reduce(information), "ols")
    exact = np.linalg.lstsq(submodels[3].M, truth, rcond=None)[0]
    off = np.abs(truncated.value / exact - 1)
    # Model 4 is a truncation: it absorbs what it leaves out, by up to 2 %.
    assert 1e-4 < off.max() < 0.025


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
