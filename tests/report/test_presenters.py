"""Results hold numbers; `report/answers` says and shows them, one file a verb."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path

import pytest

import identifiability
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.result import Result
from identifiability.report.answers import FILES

PACKAGE = Path(identifiability.__file__).parent

#: What answers, tables and caveats are made with.
MAKERS = {"Answer", "Column", "Note", "Table", "frame_table"}


def kinds_of_results():
    public = (getattr(identifiability, name) for name in identifiability.__all__)
    return [kind for kind in public if isinstance(kind, type) and issubclass(kind, Result)]


@pytest.mark.parametrize("kind", kinds_of_results(), ids=lambda kind: kind.__name__)
def test_each_kind_of_result_has_a_presenter_with_its_own_frame(kind):
    home = import_module(f"identifiability.report.answers.{FILES[kind.__name__]}")
    presenter = getattr(home, f"{kind.__name__}Presenter")
    assert any("to_frame" in vars(c) for c in presenter.__mro__ if c is not Presenter)


@pytest.mark.parametrize(
    "path", sorted(PACKAGE.glob("workflows/**/*.py")), ids=lambda p: f"{p.parent.name}-{p.stem}"
)
def test_no_workflow_makes_an_answer_a_table_or_a_caveat(path):
    made = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            called = node.func.value if isinstance(node.func, ast.Attribute) else node.func
            made |= {getattr(called, "id", "")}
    assert not made & MAKERS
