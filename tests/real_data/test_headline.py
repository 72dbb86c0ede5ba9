"""Both errors of a headline on logs of real robots: other engines evaluate the written files."""

import pandas as pd
import pytest
import real_logs as exam

from identifiability import Robot, analyze
from identifiability.regression.reduction import default_ladder

from ..export.test_headline import assert_both_errors
from ..marks import everything

LONG_REPEATED = everything("KUKA 3 → 1")
LONGER = ("KUKA 1 → 3", "TX40 1 → 2", "UR10 1 → 2")
LONG = [everything(name) for name in LONGER]
CASES = ["KR300 A, C → B", *LONG]


@pytest.mark.parametrize("name", CASES)
def test_both_errors_on_a_real_log_are_found_by_other_engines(name, data, tmp_path):
    cases = exam.find_cases(data("kuka_lwr4").parent, tmp_path)
    robot, fitted, unseen = next(rest for case, *rest in cases if case == name)
    # The engines know no clock: the model is that of the file, not what the logs complete it by.
    found = analyze(robot, fitted, unseen, replicates=0, ladder=default_ladder(Robot.of(robot)))
    assert_both_errors(robot, found, tmp_path)


@pytest.mark.parametrize("name", ["KUKA 1 → 3", LONG_REPEATED])
def test_a_motion_that_repeats_chooses_values_for_another_motion(name, data, tmp_path):
    folder = data("kuka_lwr4").parent
    case = next(rest for name_, *rest in exam.find_cases(folder, tmp_path) if name_ == name)
    assert exam.state_written(*case)["over the best"] <= 1.1


def test_written_values_err_hardly_more_than_the_best_candidate(tmp_path):
    rows = [exam.state_written(*case) for _, *case in exam.draw_cases(4, tmp_path)]
    exam.require_written(pd.DataFrame(rows).assign(case="arm "))
