"""Every study runs quickly, passes its required checks and writes a page that loads nothing."""

import json
import re
from importlib import import_module

import pytest
from paper_study.command import Options, find_studies, run_studies
from paper_study.index import find_statement, write_index
from paper_study.page import write_study
from registry import STUDIES

PAPER = [study.name for study in STUDIES if study.paper]

#: Four draws of the noise; the trials are shared by the studies of a process.
QUICK = Options(quick=True)


@pytest.mark.parametrize("name", PAPER[::3])  # all of them by test_registry.py
def test_a_quick_study_passes_and_writes_its_page(name, tmp_path):
    result = import_module(name).run(QUICK)
    assert result.name == name
    assert result.checks
    assert not result.failed
    assert not [c.name for c in result.checks if not c.passed and not c.reason]
    data, page = write_study(result, tmp_path)
    assert find_statement(page) == result.statement
    assert not re.search(r'(src|href)="https?:', page.read_text())
    content = json.loads(data.read_text())
    assert content["passed"] is True
    assert len(content["checks"]) == len(result.checks)


def test_the_index_links_every_report_with_its_result(tmp_path):
    (tmp_path / "demo.html").write_text(
        '<h1>A robot</h1><p class="statement">Nine of ten are <b>known</b>.</p>', encoding="utf-8"
    )
    run_studies(["table_1_base_parameters", "paper_slips"], QUICK, tmp_path)
    write_index(tmp_path)
    text = (tmp_path / "index.html").read_text()
    for name in ("table_1_base_parameters", "paper_slips", "demo"):
        assert f'href="{name}.html"' in text
    assert "Nine of ten are known." in text
    assert "All 2 studies of the paper pass" in text


def test_studies_go_by_short_names():
    found = {study.name for study in find_studies(["Table 4", "fig4"])}
    assert found == {"table_4_stribeck", "figure_4_noise_levels"}
