"""A log that disagrees is found before effects are named: which, where, when."""

from dataclasses import replace

import numpy as np

from identifiability import Robot, diagnose
from identifiability.estimation.estimate import estimate
from identifiability.regression.gather import gather_information
from identifiability.regression.model import Model
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose import BASE_EFFECTS
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.odd_log import locate_error, state_odd_log


def about(logs):
    robot = Robot.load("two-link")
    structure = Structure.of(robot, Model.of(*BASE_EFFECTS))
    regression = structure.regression(tuple(prepare_rows(robot, log, None) for log in logs))
    return regression, gather_information(regression)


def said(logs):
    regression, information = about(logs)
    return state_odd_log(regression, information, estimate(information))


def changed(log, since=0.0, size=0.5):
    """A log with more dry friction [N·m] in the elbow from a share of its time on."""
    more = size * np.tanh(20 * np.gradient(log.q[:, 1], log.t))
    late = log.t >= log.t[0] + since * np.ptp(log.t)
    return replace(log, tau=log.tau + np.outer(more * late, [0.0, 1.0]))


def test_a_log_with_a_changed_joint_is_told_with_joint_and_time(logs_of):
    logs = list(logs_of("two-link")[:4])
    assert said(logs) == ""
    assert said([changed(log) for log in logs]) == ""  # all of them alike
    assert said([logs[0], changed(logs[1])]) == ""  # of two nobody knows which
    text = said([logs[0], changed(logs[1]), *logs[2:]])
    assert text.startswith(f"{logs[1].name} disagrees with the other logs")
    assert "elbow.Fc" in text
    assert "errs there most in elbow, all the time" in text


def test_the_time_is_told_where_only_a_part_of_the_log_errs(logs_of):
    logs = list(logs_of("two-link")[:3])
    regression, information = about([*logs[:2], changed(logs[2], 0.5, 1.0)])
    others = estimate(information.take(information.log != 2))
    scale = np.sqrt(others.variance)
    text = locate_error(regression, 2, others.value, scale, Robot.load("two-link").joints)
    begin, end = text.partition("most from ")[2].removesuffix(" s").split(" to ")
    half = logs[2].t[0] + 0.5 * np.ptp(logs[2].t)
    assert "in elbow" in text
    assert half - 0.5 < float(begin) < float(end)


def test_a_diagnosis_says_so_first(logs_of):
    logs = logs_of("two-link")
    logs = [changed(logs[0]), *logs[1:]]
    d = diagnose("two-link", logs[:4], logs[4:], effects=["torque_offset"], quick=True)
    assert d.hints[0].startswith(f"{logs[0].name} disagrees with the other logs")
