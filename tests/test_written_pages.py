"""The reference pages that are written from the code say what the code says."""

import ast
import re
import runpy
import tomllib
from importlib import import_module
from pathlib import Path
from string import Formatter

import pytest
from pydantic import TypeAdapter

import identifiability
from identifiability.effects import FAMILIES
from identifiability.foundation.findings import Level, sentences
from identifiability.quality.registry import CHECKS
from identifiability.regression.reduction import LadderEntry
from identifiability.robot.sidecar import Sidecar

#: What makes sentences of the table.
CALLS = ("Finding", "phrase")

DOCS = Path(__file__).resolve().parents[1] / "docs"
WRITTEN = runpy.run_path(str(DOCS / "written.py"))


def test_pages_are_what_the_code_says():
    pages = {path: text for path, text in WRITTEN["pages"]().items() if path.suffix == ".md"}
    assert len(pages) == 7
    for path, text in pages.items():
        assert path.read_text() == text, f"{path.name} is old; run make docs"
    effects = pages[DOCS / "reference/effects.md"]
    assert all(f"\n`{name}`\n" in effects for name in FAMILIES)


@pytest.mark.parametrize("document", [Sidecar, LadderEntry])
def test_every_key_has_an_example_that_its_table_takes_and_that_toml_reads_back(document):
    for _, table in WRITTEN["tables"](document):
        for name, field in table.model_fields.items():
            for example in field.examples or ():
                TypeAdapter(field.annotation).validate_python(example)
                read = tomllib.loads(f"x = {WRITTEN['toml_of'](example)}")["x"]
                assert read == example, name


def test_every_check_stands_in_the_order_and_in_the_table_of_sentences():
    table = sentences()
    import_module("identifiability.workflows.case")  # whose checks need a fit
    checks = {check.key for check in CHECKS}
    assert [check.key for check in CHECKS] == [key for key in table if key in checks]
    for key, own in table.items():
        if "level" not in own:  # a refusal, which says all
            continue
        assert Level(own["level"]), key
        assert own["means"].strip().endswith("."), key
        assert own["do"].strip().endswith("."), key
    assert checks <= {*table}


def test_the_page_of_messages_shows_every_message_and_each_of_its_parts_without_holes():
    page = (DOCS / "reference/messages.md").read_text()
    rows = dict(re.findall(r"^\| `([\w.]+)` \| (.*?) \| ", page, re.MULTILINE))
    documented = {key: own for key, own in sentences().items() if "level" in own}
    assert {*rows} == {*documented}
    examples = tomllib.loads((DOCS / "message_examples.toml").read_text())
    for key, says in rows.items():
        said = re.sub(r"\d … [-\d]|= …", "", says)  # a range, and what is to be filled in
        assert not re.search(r"…|{\w*}|{\w+:|[a-z]}", said), key
        parts = {*documented[key]} - {"level", "says", "means", "do", "done", "decides", "told"}
        shown = {part for part in parts if f"'part': '{part}'" in str(examples[key])}
        assert shown == parts, key


def holes(text):
    return {name.partition(".")[0] for _, name, _, _ in Formatter().parse(text) if name}


def test_every_finding_and_phrase_fills_the_holes_of_its_sentence():
    """A sentence that is said seldom is written as surely as one that is said often."""
    table = sentences()
    seen = set()
    for path in Path(identifiability.__file__).parent.rglob("*.py"):
        for call in ast.walk(ast.parse(path.read_text())):
            if not isinstance(call, ast.Call) or getattr(call.func, "id", "") not in CALLS:
                continue
            first, *rest = call.args
            if not isinstance(first, ast.Constant):
                continue  # what builds them
            part = "says"
            if call.func.id == "phrase":
                parts = [n.value for n in ast.walk(rest[0]) if isinstance(n, ast.Constant)]
                if not parts:
                    continue  # a part that is chosen when it runs
                part = parts[0]
            given = {k.arg for k in call.keywords} | {"subject"}
            seen.add(first.value)
            wanted = holes(table[first.value][part])
            assert wanted <= given or None in given, (path.name, first.value, part)
    assert {check.key for check in CHECKS} - {"commands"} <= seen
