"""The first screen: graded errors and trust."""

import numpy as np

from identifiability.foundation.answers import Note
from identifiability.report.answers.common import answer_quality, answer_trust


def test_quality_names_the_worst_joint():
    answer = answer_quality(
        0.05, ("a", "b", "c"), np.array([0.04, 0.09, 0.02]), "Measured on another log."
    )
    assert answer.short == "Good: relative validation error 5.00 %."
    assert "Worst joint, over its own variation: b 9.00 %." in answer.text
    assert answer.text.endswith("Measured on another log.")
    assert answer.tone == "green"


def test_one_joint_lowers_word_and_colour_where_it_errs_three_times_as_much():
    joints, each = ("a", "b"), np.array([0.01, 0.07])
    alike = answer_quality(0.025, joints, each, "")
    assert (alike.short, alike.tone) == ("Very good: relative validation error 2.50 %.", "green")
    apart = answer_quality(0.02, joints, each, "")
    assert apart.short.startswith("Good in b (7.00 % over its own variation)")
    assert apart.tone == "amber"
    unmeasured = answer_quality(0.02, joints, np.array([np.nan, 0.01]), "")
    assert unmeasured.short.startswith("Very good")
    useless = answer_quality(0.02, joints, np.array([0.01, 33.0]), "")
    assert (useless.short.split()[0], useless.tone) == ("Useless", "vermilion")


def test_a_warning_leaves_no_very_good_and_no_yes():
    warned = answer_quality(0.02, ("a",), np.array([0.02]), "", warnings=["x"])
    assert warned.short.startswith("Fair at best, see the warning")
    assert warned.tone == "amber"
    poor = answer_quality(0.3, ("a",), np.array([0.3]), "", warnings=["x"])
    assert poor.short == "Poor: relative validation error 30.0 %."
    trust = answer_trust([], "", 3, 4, warnings=["x"])
    assert (trust.short, trust.tone) == ("With care: read the warning.", "amber")


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note, warning = Note("note", "Small.", ""), Note("warning", "Grave.", "")
    assert answer_trust([note], "", 3, 4).short.startswith("Yes")
    assert answer_trust([note, warning], "", 3, 4).short == "With care: “Grave”."
    assert answer_trust([note], "nothing moved", 3, 4).short == "No: nothing moved"
