"""The reference pages that are written from the code say what the code says."""

import ast
import re
import runpy
import tomllib
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from identifiability.effects import FAMILIES
from identifiability.regression.reduction import LadderEntry
from identifiability.robot.sidecar import Sidecar
from identifiability.workflows.oddities.check import CHECKS

DOCS = Path(__file__).resolve().parents[1] / "docs"
WRITTEN = runpy.run_path(str(DOCS / "written.py"))


def test_pages_are_what_the_code_says():
    pages = {path: text for path, text in WRITTEN["pages"]().items() if path.suffix == ".md"}
    assert len(pages) == 7
    for path, text in pages.items():
        assert path.read_text() == text, f"{path.name} is old; run make docs"
    effects = pages[DOCS / "reference" / "effects.md"]
    assert all(f"\n`{name}`\n" in effects for name in FAMILIES)


def test_every_number_of_an_algorithm_is_on_the_page_and_there_are_not_more():
    numbers = [*WRITTEN["tolerances"]()]
    assert 0 < len(numbers) <= 155
    assert [n for n in numbers if len(n[2]) < 20] == []


@pytest.mark.parametrize("document", [Sidecar, LadderEntry])
def test_every_key_has_an_example_that_its_table_takes_and_that_toml_reads_back(document):
    for _, table in WRITTEN["tables"](document):
        for name, field in table.model_fields.items():
            for example in field.examples or ():
                TypeAdapter(field.annotation).validate_python(example)
                read = tomllib.loads(f"x = {WRITTEN['toml_of'](example)}")["x"]
                assert read == example, name


def sentences(declared):
    """Every text of the library, … for what is filled in, but for what checks declare."""
    library = DOCS.parent / "identifiability"
    speak = ("workflows", "logs", "robot", "physical", "regression")
    for path in (path for folder in speak for path in (library / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = [v.value if isinstance(v, ast.Constant) else "…" for v in node.values]
                yield "".join(map(str, parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield "" if node.value in declared else node.value


def test_every_check_stands_on_the_page_of_messages_with_what_it_really_says():
    declared = {check.says for check in CHECKS}
    said = "\n".join(" ".join(text.split()) for text in sentences(declared))
    for check in CHECKS:
        assert check.means.endswith("."), check.title
        assert check.do.endswith("."), check.title
        parts = [re.escape(part) for part in check.says.strip("…").split("…")]
        assert re.search("[^\\n]*?".join(parts), said), f"nothing says {check.says!r}"
