"""The first screen: graded errors and trust."""

from identifiability.foundation.answers import Note
from identifiability.report.answers.common import answer_trust


def test_trust_falls_with_a_warning_and_is_gone_with_a_doubt():
    note = Note("note", "Small.", "")
    warning = Note("warning", "Grave.", "")
    assert answer_trust([note], "").short.startswith("Yes")
    assert answer_trust([note, warning], "").short == "With care: “Grave”."
    assert answer_trust([note], "nothing moved").short == "No: nothing moved"
    assert answer_trust([note], "", in_doubt="a").tone == "amber"
