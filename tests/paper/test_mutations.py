"""The checks can fail: a wrong robot or a wrong model fails those that name it."""

from pathlib import Path

import figure_5_split_forces
import pytest
import table_1_base_parameters
import table_3_noise
import table_6_no_actuators
from paper_study.command import Options
from paper_study.result import StudyResult


def failed(result: StudyResult) -> set[str]:
    return {c.name for c in result.failed}


@pytest.mark.everything
def test_a_platform_edge_one_percent_longer_fails_the_coefficients_of_table_1(changed_robot):
    robot = changed_robot("make_robot.py", "EDGE = 0.4563", "EDGE = 0.4563 * 1.01")
    result = table_1_base_parameters.run(Options(quick=True, robot=robot))
    assert failed(result) == {
        "groupings with every printed coefficient",
        "coefficients of Table 1",
        "CAD value of mx(3)+0.5774my(3)-0.4563(m(3)+m(2))",
    }
    assert not result.passed


def test_a_dropped_column_of_model_4_fails_its_size_and_rows(changed_robot):
    robot = changed_robot("ladder.toml", '  "platform.mx", "leg2_upper.m",', '  "leg2_upper.m",')
    options = Options(quick=True, seeds=1, robot=robot)
    assert {"sizes of Models 1 to 4", "rows of Table 1 in Model 4"} <= failed(
        table_1_base_parameters.run(options)
    )


@pytest.mark.everything
def test_a_dropped_column_of_model_4_fails_the_count_of_every_trial(changed_robot):
    robot = changed_robot("ladder.toml", '  "platform.mx", "leg2_upper.m",', '  "leg2_upper.m",')
    options = Options(quick=True, seeds=1, robot=robot)
    trials = table_3_noise.noise_trials(options)
    wrong = {c.name for c in table_3_noise.find_checks(trials) if not c.passed}
    assert {
        "sizes of Models 1 to 4",
        "properly identified of Model 4, every trial",
    } <= wrong


@pytest.mark.everything
def test_a_robot_without_actuator_inertia_fails_table_6_and_figure_5(changed_robot):
    """Nothing is neglected then, so no model can be the worse for it."""
    robot = changed_robot("make_robot.py", 'armature="483.1"', 'armature="0"')
    text = Path(robot).with_name("robot.toml")
    kept = text.read_text(encoding="utf-8").replace("= 183.1", "= 0.0").replace("= 300.0", "= 0.0")
    text.write_text(kept, encoding="utf-8")
    options = Options(quick=True, seeds=1, robot=robot)
    wrong = failed(table_6_no_actuators.run(options))
    assert "ε_RA of Model 4, mean over trajectories" in wrong
    assert "Model 1 ≪ 2 ≤ 3 ≪ 4 on every trajectory, smallest ratios" in wrong
    wrong = failed(figure_5_split_forces.run(options))
    assert "rigid-body part, mean error over mean size" in wrong
