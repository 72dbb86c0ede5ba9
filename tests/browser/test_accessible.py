"""axe-core on the reports: nothing that keeps anybody from reading them."""

import re
from pathlib import Path

import pytest

OPEN = "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
DETAIL = "document.getElementById('statistics')?.click()"
FOUND = """async () => (await axe.run()).violations.filter((v) => v.impact !== "minor").map(
  (v) => [v.impact, v.id, v.nodes[0].html.slice(0, 120)])"""

#: The two kinds with the most in them: one on a telephone, the other on a screen.
DEFAULT = (("analysis", 400), ("pruning", 1280))


@pytest.fixture(scope="session")
def axe():
    """The script of axe-core, which comes with a package."""
    package = pytest.importorskip("axe_playwright_python", reason="needs the extra 'browser'")
    return (Path(package.__file__).parent / "axe.min.js").read_text()


@pytest.mark.parametrize("kind, width", DEFAULT)
def test_everybody_can_read_a_report_with_all_that_can_be_opened(kind, width, reports, visit, axe):
    with visit(reports[kind], width) as seen:
        seen.page.evaluate(axe)
        seen.page.evaluate(OPEN)
        seen.page.evaluate(DETAIL)
        assert seen.page.evaluate(FOUND) == []


#: What of a page does not survive its way onto paper, of which 205 mm are free.
PRINTED = """() => [...document.querySelectorAll("main *")].flatMap((e) => {
  const box = e.getBoundingClientRect(), said = [];
  if (e.matches(".plot svg") && box.height > 206 * 96 / 25.4) said.push("taller than a page");
  if (e.matches("thead button") && getComputedStyle(e).display !== "contents")
    said.push("not printed again on the next page");
  if (e.matches("section, .plot, .table") && box.right > innerWidth + 1) said.push("cut off");
  return said.map((s) => [s, e.outerHTML.slice(0, 90)]);
})"""

#: Sentences of the first screen with more words than this lose their reader.
WORDS = 25
SENTENCES = """() => [
  ...[...document.querySelectorAll(".answers :is(dt, strong, .what, figcaption)")],
  ...[...document.querySelectorAll(".answers dd")].flatMap((e) => [...e.childNodes])
    .filter((e) => e.nodeType === Node.TEXT_NODE),
].map((e) => e.textContent.trim()).filter((text) => text)"""


def test_a_page_survives_its_way_onto_paper_and_is_read_in_one_go(reports, visit):
    with visit(reports["pruning"], 688) as seen:
        seen.page.emulate_media(media="print")
        seen.page.evaluate(OPEN)
        assert seen.page.evaluate(PRINTED) == []
        texts = seen.page.evaluate(SENTENCES)
    assert texts
    for text in texts:
        for sentence in re.split(r"(?<=[.!?])\s+", text):
            assert len(re.findall(r"[A-Za-z]\S*", sentence)) <= WORDS, sentence
