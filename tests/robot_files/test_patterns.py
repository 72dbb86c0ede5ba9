"""Patterns in the tables of a sidecar are the names that fit them, written out."""

import pytest

from .made_robots import arm

PATTERNS = """
[nominal]
"*.Fv" = 0.3
"elbow.Fv" = 0.7
"link?.payload_m" = 0.1
[shapes]
"*.stribeck_friction" = 0.05
"s*.stribeck_friction" = 0.06
[limits]
"*" = {v = 2}
shoulder = {v = 1}
[torque]
gain = {"*" = 2, "el*" = 3}
compensated = ["s*"]
[[symmetry]]
tie = {"link.my" = ["link*.my"]}
"""
WRITTEN_OUT = """
[nominal]
"shoulder.Fv" = 0.3
"elbow.Fv" = 0.7
"link1.payload_m" = 0.1
"link2.payload_m" = 0.1
[shapes]
"shoulder.stribeck_friction" = 0.06
"elbow.stribeck_friction" = 0.05
[limits]
shoulder = {v = 1}
elbow = {v = 2}
[torque]
gain = {shoulder = 2, elbow = 3}
compensated = ["shoulder"]
[[symmetry]]
tie = {"link.my" = ["link1.my", "link2.my"]}
"""


def test_patterns_are_the_names_that_fit_them(load_text):
    ours, theirs = (load_text(arm(), sidecar=s) for s in (PATTERNS, WRITTEN_OUT))
    for what in ("nominal", "shapes", "ties", "torque"):
        assert getattr(ours, what) == getattr(theirs, what), what
    assert ours.speed_limits.tolist() == theirs.speed_limits.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    "line, sentence",
    [
        (
            '[nominal]\n"wrist_*.Fv" = 1',
            r"\[nominal\] names 'wrist_\*', which the robot does not have",
        ),
        ('[torque]\nsign = {"wrist_*" = -1}', r"Known: shoulder, elbow\."),
    ],
)
def test_a_pattern_that_nothing_fits_is_refused(line, sentence, load_text, rejected):
    with rejected(sentence):
        load_text(arm(), sidecar=line)


def test_a_pattern_may_fit_what_is_locked_alone(load_text):
    robot = load_text(arm(), sidecar='[nominal]\n"elb*.Fv" = 1.0\n"*.Fc" = 2.0', lock=["elbow"])
    assert {n for n in robot.nominal if n.endswith((".Fv", ".Fc"))} == {
        "shoulder.Fv",
        "shoulder.Fc",
    }
