"""The report on an analysis: complete, self-contained, harmless, small, quick, always the same."""

import re

import pytest

from identifiability.report import write_result

pytestmark = pytest.mark.pictures

SECTIONS = (
    "values", "prediction", "parameters", "models", "correlated", "physics",
    "motion", "ledger", "more",
)  # fmt: skip


@pytest.fixture(scope="module")
def html(paper_analysis, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    assert write_result(paper_analysis, path) == path
    return path.read_text()


def test_the_answer_stands_at_the_top(html, paper_analysis):
    top = html[html.index("<header>") : html.index("</header>")]
    text = re.sub(r"<[^>]*>", "", top).replace("\u00a0", " ")
    for answer in paper_analysis.answers():
        assert answer.short.replace("`", "") in text
        assert answer.text.count(". ") < 2
    assert "torque" not in text.replace("computed-torque", "")  # its motors push


def test_all_sections_are_there_and_linked(html):
    assert tuple(re.findall(r'<section\b[^>]*\bid="([^"]*)"', html)) == SECTIONS
    assert {*re.findall(r'<a\b[^>]*\bhref="([^"]*)"', html)} == {f"#{s}" for s in SECTIONS}


def test_the_report_is_small_and_the_same_each_time(html, paper_analysis, tmp_path):
    path = write_result(paper_analysis, tmp_path / "again.html")
    assert path.read_text() == html
    assert len(html.encode()) < 1_000_000


def test_hashes_are_printed_and_no_path_of_this_machine(html, paper_analysis):
    assert paper_analysis.robot.sha256 in html
    for s in (*paper_analysis.samples, *paper_analysis.validation):
        assert s.sha256 in html
    assert str(paper_analysis.robot.path.parent) not in html
