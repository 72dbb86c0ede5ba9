"""Pictures of every report in a folder, on a screen and on a phone, and a page that shows them.

``python studies/gallery.py`` opens ``reports/*.html`` in the Chromium of the system, without a
network, and writes ``reports/gallery/*.png`` and ``reports/gallery/index.html``. Make the reports
first: ``make demo paper``. Needs Chromium and the extra ``browser``.
"""

from __future__ import annotations

import argparse
import base64
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from identifiability.cli.common import sentences
from identifiability.foundation.errors import IdentifiabilityError, OutputError
from identifiability.foundation.output import write_bytes
from identifiability.report import Cell, Column, Section, Table, write_page

ROOT = Path(__file__).resolve().parents[1]

#: Width and height of what is shown [px].
WINDOWS = {"screen": (1280, 1600), "phone": (400, 1600)}


@dataclass(frozen=True)
class Shot:
    """A report and its pictures, by window: the file, and a small one to stand in the page."""

    title: str
    statement: str
    report: Path
    pictures: dict[str, Path]
    small: dict[str, bytes]


def make_gallery(reports: Path, *, dark: bool = False) -> Path:
    """Write pictures of all reports of a folder and the page that shows them.

    Raises
    ------
    IdentifiabilityError
        If there is nothing to show, or no browser to show it with.
    """
    pages = sorted(p for p in reports.glob("*.html") if p.is_file())
    if not pages:
        raise IdentifiabilityError(f"There are no reports in '{reports}'; run make demo first.")
    folder = reports / "gallery"
    folder.mkdir(exist_ok=True)
    with open_browser() as browser:
        shots = [take(browser, page, folder, dark=dark) for page in pages]
    return write_gallery(shots, folder)


@contextmanager
def open_browser() -> Iterator[Any]:
    """Start the system's Chromium."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        raise IdentifiabilityError("There is no Chromium; install the package chromium.")
    try:
        from playwright.sync_api import sync_playwright  # noqa: PLC0415 - an extra
    except ImportError:
        raise IdentifiabilityError(
            "Pictures need the extra 'browser': pip install 'robot-identifiability[browser]'."
        ) from None
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--disable-quic"])
        yield browser
        browser.close()


def take(browser: Any, report: Path, folder: Path, *, dark: bool = False) -> Shot:
    """Photograph one report in every window."""
    pictures, small = {}, {}
    scheme = "dark" if dark else "light"
    for window, (width, height) in WINDOWS.items():
        size = {"width": width, "height": height}
        context = browser.new_context(viewport=size, offline=True, color_scheme=scheme)
        page = context.new_page()
        page.goto(report.resolve().as_uri())
        path = folder / f"{report.stem}_{window}.png"
        pictures[window] = write_bytes(path, page.screenshot())
        small[window] = page.screenshot(type="jpeg", quality=55)
        title = page.locator("h1").first.inner_text()
        statement = page.locator(".statement").first.inner_text()
        context.close()
    return Shot(title, statement, report, pictures, small)


def write_gallery(shots: list[Shot], folder: Path) -> Path:
    """Write the page; it holds small pictures itself and links to the large ones."""
    sections = [
        Section(
            f"report-{k}",
            shot.title,
            shot.statement,
            (Table("", (Column("screen"), Column("phone")), (_pictures(shot),), cards=False),),
        )
        for k, shot in enumerate(shots)
    ]
    return write_page(
        "Gallery",
        f"{len(shots)} reports as they look on a screen and on a phone.",
        sections,
        folder / "index.html",
        overline="identifiability",
        subtitle="Click a picture to see it in full",
    )


def _pictures(shot: Shot) -> tuple[Cell, ...]:
    cells = []
    for window, picture in shot.pictures.items():
        data = base64.b64encode(shot.small[window]).decode()
        text = Markup(
            f'<a href="{escape(picture.name)}"><img alt="{escape(shot.title)} on a {window}" '
            f'style="width:100%;height:auto" src="data:image/jpeg;base64,{data}"></a>'
        )
        cells.append(Cell(text, window))
    return tuple(cells)


def main() -> None:
    """Make the gallery of the folder that is given."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reports", type=Path, default=ROOT / "reports", help="folder (reports)")
    parser.add_argument("--dark", action="store_true", help="in dark colours")
    given = parser.parse_args()
    with sentences():
        if not given.reports.is_dir():
            raise OutputError(f"There is no folder '{given.reports}'.")
        sys.stdout.write(f"{make_gallery(given.reports, dark=given.dark)}\n")


if __name__ == "__main__":
    main()
