"""Stäubli TX40, one run of the real arm: the published base parameters come out."""

from functools import cache, partial

import numpy as np
import pytest
import staubli_tx40 as tx40

pytestmark = pytest.mark.everything

module_fixture = pytest.fixture(scope="module")


@module_fixture
def folder(data):
    return data("staubli_tx40")


@module_fixture
def robot(folder):
    return tx40.load_robot(folder)


@module_fixture
def log(folder, robot):
    return tx40.load_log(folder, robot)


@module_fixture
def published(folder):
    return tx40.read_published(folder)


@module_fixture
def base(folder):
    return tx40.run_analysis(folder, "wls").base


@module_fixture
def ours(folder, base):
    return cache(partial(tx40.fit_ours, folder, base))


@module_fixture
def compared(ours, base, published):
    """A function (processing, method) -> table of the published parameters and ours."""
    return lambda processing, method: tx40.compare(
        base, ours(processing, method), published, method
    )


def test_the_transmission_is_the_formulas_that_come_with_the_data(robot, log):
    R = np.diag([32.0, 32, 45, -48, 45, 32])
    R[5, 4] = 32
    q = log.q @ np.linalg.inv(R).T
    q[:, 1] -= np.pi / 2
    q[:, 2] += np.pi / 2
    found_q, found_tau = robot.transmission.joint_side(log.q, log.tau)
    assert np.abs(found_q - q).max() < 1e-12
    assert np.abs(found_tau - log.tau @ R).max() < 1e-12  # its matrix of torque is Rᵀ


def test_every_published_grouping_means_the_same_in_our_spelling(base, published):
    T, outside = tx40.published_in_ours(base, published["expression"].tolist())
    assert len(published) == 60
    assert outside.max() < 1e-9
    assert np.linalg.matrix_rank(T) == 60


def test_we_determine_one_parameter_more_the_rotor_of_joint_6(ours, base, published):
    T, _ = tx40.published_in_ours(base, published["expression"].tolist())
    rotor = np.eye(61)[base.names.index("joint_6.Ia")]
    assert len(base.parameters) == 87  # 60 inertial, 7 × (Fv, Fc, Ia), 6 offsets
    assert base.rank == ours("ours", "wls").rank == 61
    assert np.linalg.matrix_rank(np.vstack([T, rotor])) == 61


@pytest.mark.parametrize("method", ["ols", "wls"])
@pytest.mark.parametrize("processing", ["ours", "ours, decimated as published"])
def test_the_well_known_parameters_are_within_10_percent(compared, processing, method):
    table = compared(processing, method).set_index("name")
    for name, value in tx40.WELL_KNOWN.items():
        assert table["ratio"][name] == pytest.approx(1, rel=0.10)
        if method == "wls":
            assert table["ours"][name] == pytest.approx(value, rel=0.10)


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_all_published_values_but_friction_agree_within_their_own_uncertainty(compared, method):
    table = compared("ours", method)
    friction = table["name"].str.match("f[vs]")
    assert friction.sum() == 14
    rest = table[~friction]
    assert (rest["deviation_in_sigma"] < 2).sum() >= 42
    assert rest["deviation_in_sigma"].max() < 4
    well = rest[rest["published_sigma_percent"] < 5]
    assert len(well) >= 6
    assert (well["ratio"] - 1).abs().max() < 0.05


@pytest.mark.parametrize("method", ["ols", "wls"])
def test_the_log_treated_as_published_gives_all_published_values(folder, base, published, method):
    fit = tx40.fit_published(folder, base, method)
    table = tx40.compare(base, fit, published, method)
    assert fit.rank == 60  # the last joint's acceleration was left at zero, so no Ia6
    assert table["deviation_in_sigma"].max() < 1
    spread = table["our_sigma_percent"] * table["ours"].abs()
    theirs = table["published_sigma_percent"] * table["published"].abs()
    assert (spread / theirs).between(0.94, 1.06).all()


def test_with_the_last_joints_acceleration_its_rotor_is_found(folder, base, published):
    fit = tx40.fit_published(folder, base, "wls", wrist=True)
    assert fit.rank == 61
    assert tx40.compare(base, fit, published, "wls")["within_2_sigma"].sum() >= 57
