"""Results hold numbers; `report/answers` says and shows them."""

import ast
from pathlib import Path

import pytest

import identifiability
from identifiability.report.answers.common import WORDS

PACKAGE = Path(identifiability.__file__).parent

#: What answers, tables and caveats are made with.
MAKERS = {"Answer", "Column", "Note", "Table", "frame_table"}


@pytest.mark.parametrize("verb", ["", "prediction.", "rollout.", "payload.", "comparison."])
def test_an_answer_that_asks_for_care_says_so_first(verb):
    said = WORDS[f"{verb}trust"]
    for part, tone in said["tones"].items():
        assert said[part].startswith("With care: ") == (tone == "amber")


@pytest.mark.parametrize("path", sorted(PACKAGE.glob("workflows/**/*.py")))
def test_no_workflow_makes_an_answer_a_table_or_a_caveat(path):
    made = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call):
            called = node.func.value if isinstance(node.func, ast.Attribute) else node.func
            made |= {getattr(called, "id", "")}
    assert not made & MAKERS
