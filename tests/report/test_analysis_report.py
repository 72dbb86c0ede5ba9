"""The report on an analysis: complete, self-contained, harmless, small, quick, always the same."""

import re
from html.parser import HTMLParser

import pytest

from identifiability.foundation.rounding import error_text
from identifiability.report import write_analysis_report
from identifiability.report.results import build_page
from identifiability.workflows.answers import level_table

pytestmark = pytest.mark.pictures

SECTIONS = (
    "prediction", "parameters", "models", "correlated", "motions", "residuals", "physics",
    "structure", "full-model", "motion", "thresholds", "provenance", "ledger", "rules",
)  # fmt: skip


class Outline(HTMLParser):
    """What a browser would see: tags with attributes, and the rows of every table."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.section = ""
        self.rows: dict[str, list[str]] = {}
        self._header = False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append((tag, attributes))
        if tag == "section":
            self.section = attributes["id"]
        self._header = tag == "th" and attributes.get("scope") == "row"

    def handle_data(self, data):
        if self._header:
            self.rows.setdefault(self.section, []).append(data)
            self._header = False

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [a for t, a in self.tags if t == tag]


@pytest.fixture(scope="module")
def html(paper_analysis, tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("report") / "report.html"
    assert write_analysis_report(paper_analysis, path) == path
    return path.read_text(encoding="utf-8")


def test_the_answer_stands_at_the_top(html, paper_analysis):
    top = html[html.index("<header>") : html.index("</header>")]
    text = re.sub(r"<[^>]*>", "", top).replace("\u00a0", " ")
    for answer in paper_analysis.answers():
        assert answer.short in text
    for number in ("85", "37", error_text(paper_analysis.chosen.error_ra_validation)):
        assert number in text


def test_all_sections_are_there_and_linked(html):
    outline = Outline(html)
    assert tuple(a["id"] for a in outline.all("section")) == SECTIONS
    assert {a["href"] for a in outline.all("a")} == {f"#{s}" for s in SECTIONS}


def test_nothing_is_loaded_from_anywhere(html):
    outline = Outline(html)
    for tag, attributes in outline.tags:
        for name in ("src", "href", "xlink:href", "data", "action", "srcset", "poster"):
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:,")), (tag, name, value)
    assert not re.search(r"(https?:)?//[a-z]+\.", html)
    assert "@import" not in html
    assert "@font-face" not in html
    assert len(outline.all("script")) == 1


def test_the_report_is_small_and_the_same_each_time(html, paper_analysis, tmp_path):
    path = write_analysis_report(paper_analysis, tmp_path / "again.html")
    assert path.read_text(encoding="utf-8") == html
    assert len(html.encode()) < 1_000_000


def test_thresholds_and_hashes_are_printed(html, paper_analysis):
    assert paper_analysis.robot.sha256 in html
    for s in (*paper_analysis.samples, *paper_analysis.validation):
        assert s.sha256 in html
    page = build_page(paper_analysis)
    (folds,) = (s.blocks for s in page.sections if s.name == "rules")
    assert [len(f.blocks[0].rows) for f in folds] == [
        len(rules.rows()) for rules in paper_analysis.decided_by()
    ]
    for level, condition in ([cell.text for cell in row] for row in level_table().rows):
        assert f">{level}<" in html
        assert condition in html.replace("\u00a0", " ")


def test_no_path_of_this_machine_is_told(html, paper_analysis):
    assert str(paper_analysis.robot.path.parent) not in html
