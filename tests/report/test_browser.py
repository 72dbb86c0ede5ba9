"""The report in a real browser: sorting and filters work; tests/browser has what every page can."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from identifiability.report import write_analysis_report

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip

pytestmark = pytest.mark.skipif(BROWSER is None, reason="needs Chromium")


def browse(page: Path, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [BROWSER, *QUIET, f"--user-data-dir={folder}", *options, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)


def measure(html: str, script: str, width: int, folder: Path):
    """Return what a script finds in a frame of some width (windows are at least 500 px wide)."""
    html = re.sub(r"<meta http-equiv=[^>]*>", "", html)  # else only the page's own script may run
    inner = folder / "inner.html"
    inner.write_text(html, encoding="utf-8")
    outer = folder / "outer.html"
    outer.write_text(
        f'<iframe src="inner.html" style="width:{width}px;height:900px;border:0"></iframe>'
        "<script>onload = () => { const view = frames[0], page = view.document;"
        f"document.title = JSON.stringify((() => {{ {script} }})()); }}</script>",
        encoding="utf-8",
    )
    options = ("--allow-file-access-from-files", "--enable-logging=stderr", "--dump-dom")
    found = browse(outer, folder / "profile", *options)
    title = re.search(r"<title>(.*?)</title>", found.stdout, re.DOTALL)
    assert title, [line for line in found.stderr.splitlines() if "CONSOLE" in line]
    return json.loads(title[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))


@pytest.fixture(scope="module")
def pages(paper_analysis, believed_analysis, tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    return {
        "paper": write_analysis_report(paper_analysis, folder / "paper.html"),
        "belief": write_analysis_report(believed_analysis, folder / "belief.html"),
    }


@pytest.mark.parametrize("name", ["paper", "belief"])
def test_on_a_wide_window_no_table_needs_to_scroll(pages, name, tmp_path):
    script = """
    for (const fold of page.querySelectorAll("details")) fold.open = true;
    return [...page.querySelectorAll(".table-box")].map((e) => e.scrollWidth - e.clientWidth);
    """
    html = pages[name].read_text(encoding="utf-8")
    assert set(measure(html, script, 1280, tmp_path)) == {0}


def test_on_a_phone_rows_become_cards_that_say_what_each_number_is(pages, tmp_path):
    script = """
    const cell = page.querySelector("#parameters tbody td");
    return [view.getComputedStyle(cell.parentNode).display, cell.dataset.label,
            view.getComputedStyle(cell, "::before").content, cell.getAttribute("role")];
    """
    html = pages["paper"].read_text(encoding="utf-8")
    assert measure(html, script, 400, tmp_path) == ["grid", "value", '"value"', "cell"]


def test_tables_sort_by_number_and_say_so(pages, tmp_path):
    script = """
    const table = page.querySelector("#full-model details details table");
    const header = table.rows[0].cells[5];
    const column = () => [...table.tBodies[0].rows].map((r) => r.cells[5].dataset.key);
    header.querySelector("button").click();
    const up = [header.getAttribute("aria-sort"), column()];
    header.querySelector("button").click();
    const down = [header.getAttribute("aria-sort"), column()];
    const focusable = header.querySelector("button").tabIndex;
    table.rows[0].cells[0].querySelector("button").click();
    return [up, down, focusable, header.getAttribute("aria-sort"),
            [...table.tBodies[0].rows].map((r) => r.cells[0].firstChild.textContent)];
    """
    html = pages["paper"].read_text(encoding="utf-8")
    up, down, focusable, after, names = measure(html, script, 1280, tmp_path)
    keys = [float(k) for k in up[1]]
    assert up[0] == "ascending"
    assert keys == sorted(keys)
    assert down == ["descending", up[1][::-1]]
    assert focusable == 0
    assert after == "none"
    assert names[0] == min(names, key=str.lower)


def test_chips_show_only_the_rows_with_their_verdict(pages, tmp_path):
    script = """
    const box = page.querySelector("#full-model details details .table");
    const chips = [...box.querySelectorAll(".chip")];
    const shown = () => [...box.querySelectorAll("tbody tr")].filter((r) => !r.hidden)
      .map((r) => r.dataset.word);
    const all = shown().length;
    chips[0].click();
    const some = shown(), said = box.querySelector(".shown").textContent;
    const pressed = chips[0].getAttribute("aria-pressed");
    chips[0].click();
    return [all, some, said, pressed, shown().length];
    """
    html = pages["paper"].read_text(encoding="utf-8")
    total, some, said, pressed, back = measure(html, script, 1280, tmp_path)
    assert len(set(some)) == 1
    assert said == f"{len(some)} of {total} shown"
    assert pressed == "true"
    assert back == total


@pytest.mark.parametrize("name", ["paper", "belief"])
def test_text_can_be_read_on_a_phone(pages, name, tmp_path):
    script = """
    return [...page.querySelectorAll("svg")].filter((e) => e.clientWidth).map((e) =>
      10.5 * e.clientWidth / e.viewBox.baseVal.width);
    """
    html = pages[name].read_text(encoding="utf-8")
    sizes = measure(html, script, 400, tmp_path)
    assert len(sizes) >= 10
    assert min(sizes) > 7
