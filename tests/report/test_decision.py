"""The first screen: graded errors and trust."""

import numpy as np

from identifiability.foundation.answers import Note
from identifiability.report.answers.common import answer_quality, answer_trust


def test_quality_names_the_worst_joint_and_praises_nothing_in_doubt():
    answer = answer_quality(
        0.05,
        "abc",
        np.array([0.04, 0.09, 0.02]),
        ["1 N", "3 N", "2 N"],
        "Measured on another log.",
        reserved=True,
    )
    assert answer.short.endswith("5.00 %; most in b: 9.00 % (3 N rms).")
    assert answer.text == "Measured on another log."
    assert answer.tone == "grey"


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note = Note("note", "Small.", "")
    warning = Note("warning", "Grave.", "")
    assert answer_trust([note], "").short.startswith("Yes")
    assert answer_trust([note, warning], "").short == "With care: “Grave”."
    assert answer_trust([note], "nothing moved").short == "No: nothing moved"
    assert answer_trust([note], "", in_doubt=["a"]).tone == "amber"
