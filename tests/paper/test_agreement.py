"""A required check allows the paper's number, and a card says no more than its numbers do."""

import json
import re

import pandas as pd
import pytest
from paper_study.index import write_index
from paper_study.page import write_study
from paper_study.result import StudyResult, StudyTable, check_holds, check_range

from identifiability.report import check_cell

PASS = check_holds("a law", "so", passed=True, tolerance="so")
DIFFERS = check_holds("a number", "3", passed=False, tolerance="5", required=False, reason="of x")
FAILS = check_holds("a law", "not so", passed=False, tolerance="so")
CELL = check_cell("cannot be compared: 3 … 4000", None, "paper 52")


def study(*checks, cell=None):
    tables = () if cell is None else (StudyTable("Numbers", pd.DataFrame({"ours": [cell]})),)
    return StudyResult("table_0", "Table 0", "Is it so?", "It is.", checks, tables)


@pytest.mark.parametrize(
    "result, tone",
    [
        (study(PASS), "green"),
        (study(PASS, DIFFERS), "amber"),
        (study(PASS, cell=check_cell("3", passed=False, reason="of x")), "amber"),
        (study(PASS, cell=CELL), "amber"),
        (study(PASS, FAILS, DIFFERS), "vermilion"),
    ],
    ids=["all agree", "a check differs", "a cell differs", "not comparable", "a law fails"],
)
def test_a_card_is_green_only_where_every_number_agrees(result, tone, tmp_path):
    page = write_study(result, tmp_path)[-1]
    index = write_index(tmp_path)
    for path in (page, index):
        cards = re.findall(r'<div class="tone-(\w+)">', path.read_text())
        assert cards == [tone], path.name


def test_a_card_counts_what_is_required_and_what_differs(tmp_path):
    data, page = write_study(study(PASS, PASS, DIFFERS, cell=CELL), tmp_path)
    text = page.read_text()
    assert "All 2 required checks pass." in text
    assert "1 printed number differs, with its reason. 1 cannot be compared." in text
    stored = json.loads(data.read_text())
    assert (stored["verdict"], stored["differing"], stored["not_comparable"]) == ("partly", 1, 1)


def test_a_required_check_cannot_exclude_the_number_that_the_paper_prints():
    assert (
        check_range("ε", [4.4], 4.1, 4.8, unit="%", printed=[4.57, 4.73]).paper == "4.57 … 4.73 %"
    )
    with pytest.raises(ValueError, match="a required check must allow the printed 2"):
        check_range("ε", [0.6], 0.3, 1.1, printed=2.05)
    assert not check_range("ε", [0.6], 1.75, 2.35, printed=2.05, required=False).passed
