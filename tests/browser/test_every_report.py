"""Every kind of report in a real browser: silent, offline, sortable, no wider than its window."""

import html
import re
import shlex

from ..conftest import COMMANDS

#: Two frames, after which what is drawn has the size of its box.
FRAMES = """() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"""

#: How far the page, and what stands outside scrolling boxes, reaches beyond the window [px].
BEYOND = """() => {
  for (const fold of document.querySelectorAll("details")) fold.open = true;
  const root = document.documentElement, width = root.clientWidth;
  const out = [...document.querySelectorAll("main *")].filter((e) =>
    !e.closest(".table-box, .plot-box, .command, svg *")
      && e.getBoundingClientRect().right > width + 1);
  return [root.scrollWidth - width, out.map((e) => e.outerHTML.slice(0, 90))];
}"""

#: Texts that are cut off by their own box.
CUT = """() => [...document.querySelectorAll("th, td, p, li, dd, .badge")].filter(
  (e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0
    && getComputedStyle(e).overflow !== "visible").map((e) => e.outerHTML.slice(0, 90))"""

#: For each column of each table: whether its button is seen, the keys before and after each of two
#: clicks, and the direction that the header then says.
SORTED = """() => [...document.querySelectorAll("table")].flatMap((table) =>
  [...(table.tHead?.rows[0].cells ?? [])].map((header, c) => {
    const keys = () => [...table.tBodies[0].rows].map(
      (r) => r.cells[c].dataset.key ?? r.cells[c].textContent.trim());
    const button = header.querySelector("button"), seen = button.checkVisibility();
    const click = () => { button.click(); return [header.getAttribute("aria-sort"), keys()]; };
    return [seen, keys(), click(), click()];
  }))"""

#: For each link of the contents: where it says that it leads, where a click leads, and how many
#: such places there are.
LINKS = """() => [...document.querySelectorAll("nav a")].map((link) => {
  const name = link.getAttribute("href");
  link.click();
  return [name, location.hash, document.querySelectorAll(name).length];
})"""


#: The colour of a page, and that of its worst answer; a warning is amber.
WORST = """() => {
  const header = document.querySelector("header");
  const colour = () => getComputedStyle(header).borderTopColor, page = colour();
  const worst = ["vermilion", "amber", "green", "blue"].find((tone) => header.querySelector(
    `dl > .tone-${tone}${tone === "amber" ? ", .note-warning" : ""}`));
  if (worst) header.style.borderTopColor = `var(--${worst})`;
  const said = colour();
  header.style.borderTopColor = "";
  return [page, said];
}"""


def test_the_worst_answer_sets_the_colour_of_a_page(seen):
    page, worst = seen.page.evaluate(WORST)
    assert page == worst


def test_a_report_is_silent_and_needs_no_network(report, seen):
    assert seen.page.locator("main h1").count() == 1
    seen.page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    assert seen.complaints == []
    assert [u for u in seen.requests if not u.startswith("data:")] == [report.as_uri()]
    assert seen.page.evaluate("[...document.scripts].length") == 1


def test_a_report_is_never_wider_than_its_window(seen):
    for width in (400, 1280):
        seen.page.set_viewport_size({"width": width, "height": 900})
        assert seen.page.evaluate("innerWidth") == width
        seen.page.evaluate(BEYOND)  # which opens what is folded
        seen.page.evaluate(FRAMES)
        assert seen.page.evaluate(BEYOND) == [0, []]
        assert seen.page.evaluate(CUT) == []


def test_every_column_of_every_table_sorts_by_click(seen):
    seen.page.evaluate(
        "document.querySelectorAll('details').forEach((d) => d.open = true);"
        "document.querySelector('#statistics:not(:checked)')?.click()"
    )
    seen.page.evaluate(FRAMES)
    columns = seen.page.evaluate(SORTED)
    for shown, before, up, down in columns:
        assert shown
        assert (up[0], down[0]) == ("ascending", "descending")
        assert sorted(up[1]) == sorted(before) == sorted(down[1])
        assert_ascending(up[1])
        assert_ascending([k for k in down[1] if k][::-1])
    assert columns or seen.page.locator("table").count() == 0
    if columns:  # and a reader can do it
        header = seen.page.locator("table thead th").first
        header.locator("button").click()
        assert header.get_attribute("aria-sort") == "ascending"
    assert seen.complaints == []


def assert_ascending(keys):
    """Check the order where all keys are numbers; words follow the browser's own collation."""
    known = [k for k in keys if k]
    assert keys[: len(known)] == known or keys[-len(known) :] == known
    try:
        numbers = [float(k) for k in known]
    except ValueError:
        return
    assert numbers == sorted(numbers)


def test_a_link_of_the_contents_leads_to_its_section(seen):
    for name, leads, found in seen.page.evaluate(LINKS):
        assert (leads, found) == (name, 1)
    assert seen.complaints == []


def test_every_line_to_copy_is_a_command_with_options_that_it_has(reports):
    lines = set()
    for page in map(reports.__getitem__, ("analysis", "comparison", "pruning")):
        texts = re.findall(r'data-copy="([^"]*)"', page.read_text())
        lines |= {part for text in texts for part in html.unescape(text).split(" && ")}
    assert len({line.split()[1] for line in lines}) >= 4
    for line in lines:
        _, name, *words = shlex.split(line)
        known = {option for p in COMMANDS[name].params for option in p.opts}
        assert {w for w in words if w.startswith("--")} <= known, line


def test_names_from_files_are_shown_and_not_run(reports, visit):
    with visit(reports["analysis"]) as seen:
        assert "<script>alert(1)</script>" in seen.page.locator("main").inner_text()
        assert seen.page.locator("main script").count() == 0
        assert seen.complaints == []
