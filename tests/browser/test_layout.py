"""Pages in a real browser: tables fit, sort and filter; a telephone shows all; axes have labels."""

import pytest

CARD = """async () => {
  document.querySelector("#parameters details").open = true;
  await new Promise((seen) => setTimeout(seen, 500));
  const cell = document.querySelector("#parameters tbody td");
  return [getComputedStyle(cell.parentNode).display, cell.dataset.label, cell.getAttribute("role")];
}"""


#: Where headline, line to copy, fold of the others, picture and values begin [px].
FIRST = """() => [".answers strong", "figure", ".command", ".others", "table"].map(
  (name) => document.querySelector(name).getBoundingClientRect().top)"""

FILTERED = """() => {
  const box = [...document.querySelectorAll(".table")]
    .find((table) => table.querySelector(".chip[data-word]"));
  const chips = [...box.querySelectorAll(".chip")];
  const shown = () => [...box.querySelectorAll("tbody tr")].filter((r) => !r.hidden)
    .map((r) => r.dataset.word);
  const all = shown().length;
  chips[0].click();
  const some = shown(), said = box.querySelector(".shown").textContent;
  const pressed = chips[0].getAttribute("aria-pressed");
  chips[0].click();
  return [all, some, said, pressed, shown().length];
}"""

SIZES = """() => [...document.querySelectorAll("svg text, svg tspan")].map((e) => {
  const drawing = e.closest("svg"), scale = drawing.clientWidth / drawing.viewBox.baseVal.width;
  return scale * parseFloat(getComputedStyle(e).fontSize);
}).filter((size) => size)"""

#: Height of a page [px], without end where a command is cut off.
HEIGHT = """() => [...document.querySelectorAll(".command > code")]
  .some((e) => e.scrollWidth > e.clientWidth) ? Infinity : document.body.scrollHeight"""

#: Folded models of a path, and how many the rows above them say.
FOLDED = """() => {
  const rows = [...document.querySelectorAll("#ladder tbody tr")];
  const hidden = rows.filter((row) => getComputedStyle(row).display === "none").length;
  return [hidden, rows.reduce((sum, row) => sum + (parseInt(row.dataset.folded.slice(1)) || 0), 0)];
}"""

#: Whether grey bands are explained below each joint that has some, and below no other.
GAPS = """() => [...document.querySelectorAll(".traces .chip[data-trace]")].map((chip) => {
  chip.click();
  const note = chip.closest("figure").querySelector(".gaps");
  return [JSON.parse(chip.dataset.trace).rows[1].includes(null), !note.hidden];
})"""

#: How far the page and each of its tables reach beyond what is shown [px].
BEYOND = """() => {
  const root = document.documentElement, boxes = [...document.querySelectorAll(".table-box")];
  return [root.scrollWidth - root.clientWidth, ...boxes.map((e) => e.scrollWidth - e.clientWidth)];
}"""


@pytest.mark.parametrize("kind", ["demo", "analysis"])
def test_on_a_wide_window_no_table_needs_to_scroll(kind, reports, visit):
    with visit(reports[kind], 1280) as seen:
        seen.page.evaluate("document.querySelectorAll('details').forEach((d) => d.open = true)")
        assert set(seen.page.evaluate(BEYOND)) == {0}


@pytest.mark.parametrize("look", ["flex", "table-row"])
def test_rows_become_cards_on_phones_alone_and_say_what_each_number_is(look, reports, visit):
    with visit(reports["demo"], 400 if look == "flex" else 768) as seen:
        assert seen.page.evaluate(CARD) == [look, "value", "cell"]


def test_the_picture_comes_after_the_answer_and_what_to_do_before_tables(reports, visit):
    with visit(reports["demo"], 400) as seen:
        places = seen.page.evaluate(FIRST)
    assert places == sorted(places)


def test_chips_show_only_the_rows_with_their_verdict(reports, visit):
    with visit(reports["analysis"]) as seen:
        total, some, said, pressed, back = seen.page.evaluate(FILTERED)
    assert len(set(some)) == 1
    assert said == f"{len(some)} of {total} shown"
    assert pressed == "true"
    assert back == total


def test_grey_bands_are_explained_below_the_joints_that_have_some(reports, visit):
    with visit(reports["demo"]) as seen:
        told = seen.page.evaluate(GAPS)
    assert {(has, has) for has, _ in told} == {*map(tuple, told)}


def test_a_page_says_how_many_models_of_a_path_are_folded(reports, visit):
    with visit(reports["pruning"]) as seen:
        hidden, said = seen.page.evaluate(FOLDED)
    assert hidden == said > 0


@pytest.mark.parametrize("kind", ["demo", "analysis"])
def test_text_can_be_read_on_a_phone_without_much_scrolling(kind, reports, visit):
    with visit(reports[kind], 400) as seen:
        sizes = seen.page.evaluate(SIZES)
        height = seen.page.evaluate(HEIGHT)
    assert min(sizes) >= 11
    assert height < 4000


@pytest.mark.parametrize(
    "name, width",
    [
        ("table_1_base_parameters", 400),
        ("figure_5_split_forces", 1280),
    ],
)
def test_no_table_of_a_study_is_wider_than_its_page_and_no_axis_is_unlabelled(
    name, width, study, visit
):
    result, page = study(name)
    for block in result.figures:
        for picture in getattr(block, "pictures", (block,)):
            for axes in picture.figure.axes:
                assert axes.get_xlabel(), picture.caption
                assert axes.get_ylabel(), picture.caption
    with visit(page, width) as seen:
        assert max(seen.page.evaluate(BEYOND)) <= 0
