"""Pages of the studies in a real browser: nothing is too wide, and every axis is labelled."""

import json
import re
import shutil
import subprocess
from importlib import import_module

import pytest
from paper_study.command import Options
from paper_study.page import write_study

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("chrome")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--dump-dom",
    "--disable-background-networking", "--allow-file-access-from-files",
)  # fmt: skip

#: How far the page and each of its tables reach beyond what is shown [px].
BEYOND = """
const root = page.documentElement, boxes = [...page.querySelectorAll(".table-box")];
return [root.scrollWidth - root.clientWidth, ...boxes.map((e) => e.scrollWidth - e.clientWidth)];
"""

pytestmark = pytest.mark.skipif(BROWSER is None, reason="needs Chromium")


def measure(page, width, folder):
    """Return what `BEYOND` finds in a frame of some width."""
    html = re.sub(r"<meta http-equiv=[^>]*>", "", page.read_text(encoding="utf-8"))
    (folder / "inner.html").write_text(html, encoding="utf-8")
    outer = folder / "outer.html"
    outer.write_text(
        f'<iframe src="inner.html" style="width:{width}px;height:900px;border:0"></iframe><script>'
        f"onload = () => {{ const page = frames[0].document; document.title = "
        f"JSON.stringify((() => {{ {BEYOND} }})()); }}</script>",
        encoding="utf-8",
    )
    command = [BROWSER, *QUIET, f"--user-data-dir={folder / 'profile'}", outer.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    return json.loads(re.search(r"<title>(.*?)</title>", done.stdout)[1])


@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("table_1_base_parameters", 400),
        pytest.param("table_3_noise", 1280, marks=pytest.mark.everything),
        ("figure_5_split_forces", 1280),
    ],
)
def test_no_table_is_wider_than_its_page_and_no_axis_is_unlabelled(name, width, tmp_path):
    result = import_module(name).run(Options(quick=True, seeds=1))
    for block in result.figures:
        for picture in getattr(block, "pictures", (block,)):
            for axes in picture.figure.axes:
                assert axes.get_xlabel(), picture.caption
                assert axes.get_ylabel(), picture.caption
    _, page = write_study(result, tmp_path)
    assert max(measure(page, width, tmp_path)) <= 0
