"""axe-core on the reports: nothing that keeps anybody from reading them."""

from pathlib import Path

import pytest

OPEN = "document.querySelectorAll('details').forEach((d) => { d.open = true; })"
DETAIL = "document.getElementById('statistics')?.click()"
FOUND = """async () => (await axe.run()).violations.filter((v) => v.impact !== "minor").map(
  (v) => [v.impact, v.id, v.nodes[0].html.slice(0, 120)])"""

WIDTHS = (400, 1280)
#: The two kinds with the most in them: one on a telephone, the other on a screen.
DEFAULT = (("analysis", 400), ("pruning", 1280))
LATER = (
    ("analysis", 1280),
    ("pruning", 400),
    *((kind, w) for kind in ("diagnosis", "calibration", "inspection", "demo") for w in WIDTHS),
)
GOING_ON = ("payload", "comparison", "excitation", "prediction", "robot")


@pytest.fixture(scope="session")
def axe() -> str:
    """The script of axe-core, which comes with a package."""
    package = pytest.importorskip("axe_playwright_python", reason="needs the extra 'browser'")
    return (Path(package.__file__).parent / "axe.min.js").read_text(encoding="utf-8")


def look(page: Path, width: int, visit, axe: str, *, closed: bool = True) -> None:
    """Check a page as it opens, if `closed`, and with all that can be opened open."""
    with visit(page, width) as seen:
        seen.page.evaluate(axe)
        assert not closed or seen.page.evaluate(FOUND) == []
        seen.page.evaluate(OPEN)
        seen.page.evaluate(DETAIL)
        assert seen.page.evaluate(FOUND) == []
        assert seen.complaints == []


@pytest.mark.parametrize(("kind", "width"), DEFAULT)
def test_everybody_can_read_a_report(kind, width, reports, visit, axe):
    look(reports[kind], width, visit, axe, closed=False)


@pytest.mark.everything
@pytest.mark.parametrize(("kind", "width"), [*DEFAULT, *LATER])
def test_everybody_can_read_the_others(kind, width, reports, visit, axe):
    look(reports[kind], width, visit, axe)


@pytest.mark.everything
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("kind", GOING_ON)
def test_everybody_can_read_what_goes_on_from_a_result(kind, width, later_reports, visit, axe):
    look(later_reports[kind], width, visit, axe)


def test_what_axe_finds_fails(tmp_path, visit, axe):
    page = tmp_path / "bad.html"
    page.write_text("<main><h1>a</h1><img src='data:,'><button></button></main>")
    with visit(page) as seen:
        seen.page.evaluate(axe)
        found = {rule for _, rule, _ in seen.page.evaluate(FOUND)}
    assert {"image-alt", "button-name"} <= found


@pytest.mark.everything
@pytest.mark.parametrize("kind", GOING_ON)
def test_the_first_screen_answers_with_lines_to_copy(kind, later_reports, visit):
    with visit(later_reports[kind]) as seen:
        questions = seen.page.locator(".answers dt").all_inner_texts()
        assert len(questions) == 4
        assert questions[-1] == "What next?"
        assert all(q.endswith("?") for q in questions)
        bottom = seen.page.locator(".answers dl").bounding_box()
        assert bottom["y"] + bottom["height"] < 1000
        lines = seen.page.locator(".answers .copy")
        assert lines.count() >= 1
        assert all(
            lines.nth(k).get_attribute("data-copy").startswith("identifiability ")
            for k in range(lines.count())
        )
