"""The exported robot is the fitted one, on every road.

A short form of `studies/exported_robot.py`: roads agree on motion that was not fitted, and MuJoCo
runs the exported file forward.
"""

import importlib

import pytest


@pytest.fixture(scope="module")
def study():
    return importlib.import_module("exported_robot")


def row_of(study, name, folder):
    cases = list(study.every_case(None, (name,)))
    if not cases:
        pytest.skip(f"no data of {name}")
    return study.study_case(cases[0], folder)


@pytest.mark.everything
@pytest.mark.parametrize(
    "name", ["five-bar", "differential-wrist", "dvrk-psm", "KUKA LWR4+", "TX40", "UR10"]
)
def test_the_exported_robot_is_the_fitted_one_on_every_road(name, study, tmp_path):
    row = row_of(study, name, tmp_path)
    known = {road: share for road, share in study.differences(row).items() if share == share}
    assert {"MJCF, MuJoCo", "MJCF, sidecar", "URDF, MuJoCo", "URDF, sidecar"} <= {*known}
    assert max(known.values()) < 1e-6
    assert row["runs"]
    assert row["away"] < study.NEAR
    assert row["mass of the file"] / 3 < row["mass"] < 3 * row["mass of the file"]
    (line,) = study.table([row]).to_dict("records")
    assert line["same"].passed
    assert line["stable"].passed


@pytest.mark.everything
def test_a_wrong_road_is_seen(study):
    row = {"robot": "x", "fitted": 0.1, "MJCF alone": 0.2, "MJCF, MuJoCo": 0.21}
    row |= {"MJCF, Pinocchio": float("nan"), "MJCF, sidecar": 0.1, "mass": 1, "far": ""}
    row |= {"mass of the file": 1, "runs": True, "away": 0.1}
    (line,) = study.table([row]).to_dict("records")
    assert not line["same"].passed
