"""The reference pages that are written from the code say what the code says."""

import runpy
import tomllib
from pathlib import Path

import pytest
from pydantic import TypeAdapter

from identifiability.effects import FAMILIES
from identifiability.foundation.findings import Level, sentences
from identifiability.quality.registry import CHECKS, ORDER
from identifiability.regression.reduction import LadderEntry
from identifiability.robot.sidecar import Sidecar

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


def test_every_check_stands_in_the_order_and_in_the_table_of_sentences():
    table = sentences()
    assert [check.key for check in CHECKS] == [*ORDER]
    for key, own in table.items():
        assert Level(own["level"]), key
        assert own["means"].strip().endswith("."), key
        assert own["do"].strip().endswith("."), key
    assert {*ORDER} <= {*table}
