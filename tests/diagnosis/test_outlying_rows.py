"""A burst in the torque of one joint takes no name away: it is no data, and it is said."""

import pandas as pd
import pytest

from identifiability import analyze, diagnose, new_study


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study") / "new"
    new_study(folder)
    return folder


@pytest.mark.parametrize(
    "rows, size",
    [
        (7, 1.0),
        *(pytest.param(*c, marks=pytest.mark.everything) for c in [(30, 1.0), (7, 3.0), (30, 3.0)]),
    ],
)
def test_a_burst_leaves_the_study_its_name_and_its_error(rows, size, study, named):
    burst = pd.read_csv(study / "run1.csv")
    effort = burst["joint_2.tau"]
    burst.loc[375 : 375 + rows - 1, "joint_2.tau"] += size * effort.std()
    burst.loc[600:660, "joint_2.tau"] = None
    logs = [burst, study / "run2.csv"]
    found = diagnose(study / "robot.urdf", logs, study / "run3.csv", forward=False, quick=True)
    assert named(found) == [("stribeck_friction", ("joint_2",))]
    assert found.curves[0].data.all()  # nothing is drawn of rows that nobody measured
    (placed,) = found.effects[0].placements
    assert placed.peak <= placed.values[0]
    assert found.held_after < 0.0125
    assert "the torque of joint_2 is up to" in found.details
    same = analyze(study / "robot.urdf", logs, study / "run3.csv", found, replicates=0).chosen
    errors = same.error_ra, same.error_ra_validation
    assert errors == pytest.approx((found.error_after, found.held_after), rel=1e-6)
