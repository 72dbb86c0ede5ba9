"""One browser for all tests, cut off from the network, and every kind of report to open in it."""

import shutil
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from pathlib import Path

import pytest
from numpy.random import default_rng

from identifiability import Robot, analyze, compare, diagnose, prune, simulate
from identifiability.cli.verbs import run_demo
from identifiability.robot.locate import locate_robot
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, random_trajectory

KINDS = ("demo", "comparison", "analysis", "pruning", "diagnosis", "table", "index")
LONG = "a_joint_whose_name_is_" + "very_" * 12 + "long<script>alert(1)</script>"


@dataclass
class Visit:
    """A page that is open, and what went wrong on it or left it."""

    page: object
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="session")
def chromium():
    """Debian's Chromium, driven by Playwright; nothing is downloaded."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("needs Chromium")
    client = pytest.importorskip("playwright.sync_api", reason="needs the extra 'browser'")
    with client.sync_playwright() as driver:
        # Pages scroll smoothly, for which each would be waited a second.
        options = ["--disable-quic", "--disable-smooth-scrolling"]
        browser = driver.chromium.launch(executable_path=program, args=options)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def visit(chromium):
    """A context (path, width) -> Visit of a page on a machine without a network."""

    @contextmanager
    def opened(path, width=1280):
        context = chromium.new_context(viewport={"width": width, "height": 900}, offline=True)
        page = context.new_page()
        seen = Visit(page)
        page.on("console", lambda m: seen.complaints.append(f"{m.type}: {m.text}"))
        page.on("pageerror", lambda error: seen.complaints.append(str(error)))
        page.on("requestfailed", lambda r: seen.complaints.append(f"failed: {r.url[:80]}"))
        page.on("dialog", lambda dialog: (seen.complaints.append("dialog"), dialog.dismiss()))
        page.on("request", lambda r: seen.requests.append(r.url))
        page.goto(path.as_uri())
        yield seen
        context.close()

    return opened


class Pages(dict[str, Path]):
    """Pages that are made when somebody first asks for them, for each runner asks for some."""

    def __init__(self, folder, makers):
        super().__init__()
        self.folder, self.makers = folder, makers

    def __missing__(self, kind):
        made = self.makers[kind]()
        page = made if isinstance(made, Path) else made.write_report(self.folder / f"{kind}.html")
        return self.setdefault(kind, page)


@pytest.fixture(scope="session")
def reports(tmp_path_factory, few_draws, study):
    """Every kind of report, by name."""
    folder = tmp_path_factory.mktemp("reports")
    robot, log = _hostile(folder)
    demo = cache(lambda: run_demo(quick=True)[0])

    def index():
        """The index of all reports, of which a table of the paper is one."""
        folder = study("table_1_base_parameters")[1].parent
        return import_module("paper_study.index").write_index(folder)

    def analysis():
        with few_draws():
            return analyze(robot, log, replicates=100, posterior=True)

    return Pages(
        folder,
        {
            "demo": demo,
            "comparison": partial(compare, robot, log, _record(robot, default_rng(1))),
            "analysis": analysis,
            "pruning": partial(prune, robot, log, replicates=10),
            "diagnosis": partial(diagnose, robot, log, quick=True),
            "table": lambda: study("table_1_base_parameters")[1],
            "index": index,
        },
    )


def _hostile(folder):
    """A two-link arm whose second joint has a long name with a tag in it, and its log."""
    name = LONG.replace("<", "&lt;")
    path = folder / "robot.xml"
    path.write_text(locate_robot("two-link").read_text().replace('"elbow"', f'"{name}"'))
    robot = Robot.load(path)
    return robot, _record(robot, default_rng(0))


def _record(robot, rng):
    motion = PrescribedMotion.of(random_trajectory(robot, rng), 500)
    # As a file, whose lines are of the terminal.
    return simulate(robot, motion, noise=PAPER_NOISE, rng=rng).rows(0, 500, "run.csv")


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """A function of the name of a study of the paper: its result and its page, made once."""
    folder = tmp_path_factory.mktemp("studies")
    command = import_module("paper_study.command")
    write = import_module("paper_study.page").write_study

    @cache
    def made(name):
        result = import_module(name).run(command.Options(quick=True, seeds=1))
        return result, write(result, folder)[-1]

    return made


@pytest.fixture(scope="module", params=KINDS)
def report(request, reports):
    """Every kind of report, one after the other."""
    return reports[request.param]


@pytest.fixture(scope="module")
def seen(report, visit):
    """That report, open for all tests of a module: none leaves it otherwise than it may be left."""
    with visit(report) as opened:
        yield opened
