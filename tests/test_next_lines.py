"""What is proposed next works as it is printed, where it is printed, and was not done before."""

import html
import os
import re
import shlex
import sys
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Noise, Robot, new_study, simulate
from identifiability.cli import common
from identifiability.report.answers.commands import reading_options
from identifiability.simulation import PrescribedMotion, random_trajectory

from .conftest import invoke_well, quickly, shipped_log
from .marks import everything

#: What somebody types where robot.xml, a.csv and b.csv are.
GIVEN = "robot.xml a.csv --validate b.csv"
TYPED = [
    f"diagnose {GIVEN} --report page.html",
    f"diagnose {GIVEN} --report page.html --out mine.toml --json mine.json",
    "inspect robot.xml --report page.html",
    "inspect robot.xml a.csv --report page.html",
    f"analyze {GIVEN} --report page.html",
    f"analyze {GIVEN} --report page.html --json mine.json",
    f"prune {GIVEN} --report page.html",
    f"prune {GIVEN} --report page.html --json mine.json --out mine.toml",
    "excite robot.xml --set evaluations=50 --out mine.json --report page.html",
    "excite robot.xml --set evaluations=50 --out mine.csv --report page.html",
    "compare robot.xml a.csv loaded.csv --report page.html",
    "calibrate robot.xml a.csv --replicates 4 --report page.html",
    "predict robot.xml result.json a.csv --report page.html",
    "predict robot.xml result.json loaded.csv --report page.html",
    "payload robot.xml result.json loaded.csv --body link2 --report page.html",
    "payload robot.xml result.json loaded.csv --body link2 --without a.csv --report page.html",
]
#: What `make test` runs of it.
FEW = TYPED[2:3]

NOISE = Noise(torque=0.02)

#: What somebody has yet to measure, and the log that stands for it here.
MEASURED = {"next.csv": "b.csv", "another.csv": "b.csv", "unloaded.csv": "a.csv"}


@pytest.fixture(scope="module")
def logs(two_link):
    out = {}
    for seed, (name, hidden) in enumerate(
        {"a": ["stribeck_friction=0.2"], "b": ["stribeck_friction=0.2"], "loaded": []}.items()
    ):
        motion = "b" if name == "b" else "a"
        out[name] = shipped_log(two_link, motion, 300, noise=NOISE, seed=seed, hide=hidden)
    return out


def call(words):
    """Run a command in this process, quickly; return what it says."""
    return invoke_well(*quickly(*words)).stdout


def proposed(said, page):
    """Return the lines that the terminal and the page propose, each once, in their order."""
    told = re.findall(r"^Next .*?: (identifiability .*)$", said, re.MULTILINE)
    copied = re.findall('data-copy="(identifiability [^"]*)"', page.read_text())
    return list(dict.fromkeys([*told, *map(html.unescape, copied)]))


def check(typed, folder):
    """Run a command and all that it proposes, in one folder."""
    page = folder / re.search(r"[\w/]+\.html", typed)[0]
    lines = proposed(call(shlex.split(typed)), page)
    assert lines
    for name, stands_for in MEASURED.items():
        if (folder / stands_for).is_file():
            (folder / name).write_bytes((folder / stands_for).read_bytes())
    for line in lines:
        assert line != f"identifiability {typed}"
        for part in line.split(" && "):
            program, *words = shlex.split(part)
            assert program == "identifiability"
            call(words)
    return lines


@pytest.fixture
def folder(logs, tmp_path, monkeypatch, two_link):
    """A folder with a robot and logs, in which commands are typed."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.xml").write_bytes(two_link.path.read_bytes())
    for name, log in logs.items():
        log.write(tmp_path / f"{name}.csv")
    return tmp_path


@pytest.mark.parametrize("typed", [t if t in FEW else everything(t) for t in TYPED])
def test_every_line_that_is_proposed_works_where_it_is_printed(typed, folder):
    if "result.json" in typed:
        call(shlex.split(f"analyze {GIVEN} --json result.json"))
    lines = check(typed, folder)
    if typed.startswith("predict robot.xml result.json a"):
        assert lines[0].endswith("b.csv --out model.toml --report missing.html")
    if typed.startswith(("analyze", "diagnose", "prune")):
        again = any(line.startswith(f"identifiability {typed.split()[0]} ") for line in lines)
        said = (folder / "page.html").read_text()
        assert again == bool(re.search("reruns this|repeats this run", said))
        assert not (again and "mine" in typed)


#: Options of a command that only say where its result is written.
OUTPUTS = {"--report", "--json", "--out"}
#: Steps from a first command to an exported robot.
STEPS = 8


def asked(words):
    """Return what a command computes: its words without the files that it writes."""
    pairs = pairwise(["", *words])
    return tuple(word for before, word in pairs if not OUTPUTS & {before, word})


def follow(line):
    """Run a line and what each command proposes first; return the verbs up to export or predict.

    What comes before ``&&`` may run a command again, to write the file that the last one reads.
    """
    done = set()
    verbs = []
    while len(verbs) < STEPS:
        *before, last = [shlex.split(part)[1:] for part in line.split(" && ")]
        for words in before:
            call(words)
        assert asked(last) not in done, f"{line}: leads back, after {verbs}"
        said = call(last)
        done.update(map(asked, (*before, last)))
        verbs.append(last[0])
        if last[0] in ("export", "predict"):
            return verbs
        (line,) = re.findall(r"^Next .*?: (identifiability .*)$", said, re.MULTILINE)
    raise AssertionError(f"no end after {verbs}: {line}")


@pytest.mark.parametrize(
    "robot",
    [
        "six-dof-arm",
        *(everything(r) for r in ("hobby-arm", "quadruped")),
    ],
)
def test_next_lines_of_a_new_study_end_in_an_exported_robot(robot, tmp_path, monkeypatch):
    made = new_study(tmp_path / "study", robot)
    monkeypatch.chdir(made.folder)
    verbs = follow(made.next_line.partition(" && ")[2])
    assert verbs.count("analyze") <= 2
    assert Robot.load("fitted.xml").joints == Robot.load(robot).joints
    if robot == "six-dof-arm":  # its logs have an effect that its file does not state
        assert verbs[:3] == ["analyze", "diagnose", "analyze"]
        assert "compare" not in verbs


@pytest.mark.parametrize(
    "robot, hide",
    [
        ("two-link", "stribeck_friction=0.2"),
        *(
            everything(*own)
            for own in (
                ("two-link", ""),
                ("five-bar", "stribeck_friction=0.2"),
                ("3-rrr", ""),
                ("scara", "stribeck_friction=0.2"),
                ("palletizer", ""),
                ("delta", ""),
                ("differential-wrist", ""),
            )
        ),
    ],
)
def test_next_lines_of_shipped_robots_end_in_an_exported_robot(robot, hide, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    loaded = Robot.load(robot)
    hidden = [hide] if hide else []
    for seed, name in enumerate("ab"):
        log = shipped_log(loaded, name, 500, noise=NOISE, seed=seed, hide=hidden)
        log.write(f"{name}.csv")
    verbs = follow(f"identifiability analyze {robot} a.csv --validate b.csv")
    assert ("diagnose" in verbs) >= bool(hide)
    assert verbs[-1] == "export"


def test_logs_that_disagree_are_compared_and_lead_on(tmp_path, monkeypatch, two_link):
    monkeypatch.chdir(tmp_path)
    rng = default_rng(3)
    for name, more in {"a": 0.0, "b": 0.3, "c": 0.0}.items():
        motion = PrescribedMotion.of(random_trajectory(two_link, rng, samples=1500))
        frame = simulate(two_link, motion, noise=NOISE, rng=rng).to_frame()
        frame["elbow.tau"] += more * np.sign(frame["elbow.dq"])
        frame.to_csv(f"{name}.csv", index=False)
    verbs = follow("identifiability analyze two-link a.csv b.csv c.csv")
    assert "compare" in verbs


def test_the_demo_tells_one_story_and_its_next_line_acts_on_it(tmp_path, monkeypatch):
    """What the simulation hides is told; it is missing in the answer; the next line finds it."""
    monkeypatch.chdir(tmp_path)
    said = call(["demo", "--folder", "look"])
    hidden = "Stribeck friction in joint_2"
    first, *_, last = said.splitlines()
    assert hidden in first
    assert f"{hidden} (probability" in said
    assert last.endswith((tmp_path / "look/demo.html").as_uri())
    (line,) = re.findall(r"^Next .*?: (identifiability .*)$", said, re.MULTILINE)
    found = call(shlex.split(line)[1:])
    assert found.startswith(f"What is missing? {hidden}")


def test_a_command_that_is_not_on_the_search_path_is_put_there_first(tmp_path, process):
    program = Path(sys.executable).with_name("identifiability")
    here = {**os.environ, "PATH": "/usr/bin:/bin"}
    words = [str(program), "inspect", "two-link"]
    done = process(words, cwd=tmp_path, env=here, check=True)
    (line,) = re.findall(r"^Next .*?: (\. .*)$", done.stdout, re.MULTILINE)
    process(["sh", "-c", line], cwd=tmp_path, env=here, check=True)
    assert (tmp_path / "study").is_dir()


class Cells(HTMLParser):
    """Texts of the cells of a page's tables, each without its small print."""

    def __init__(self):
        super().__init__()
        self.texts, self.inside = [], 0

    def handle_starttag(self, tag, attrs):
        self.inside = {"td": 1, "th": 1}.get(tag, self.inside)
        self.texts += [""] * (tag in ("td", "th"))

    def handle_data(self, data):
        if self.inside:
            self.texts[-1] += data


def words(text):
    """A cell without marks, and with the spaces of a terminal."""
    return " ".join(text.replace("▸", " ").split())


@pytest.mark.parametrize(
    "typed",
    [
        f"analyze {GIVEN} --report page.html",
        "predict robot.xml result.json b.csv --report page.html",
        "payload robot.xml result.json loaded.csv --body link2 --report page.html",
        "compare robot.xml a.csv loaded.csv --report page.html",
        "inspect robot.xml --report page.html",
        "inspect robot.xml a.csv --report page.html",
        "payload robot.xml a.csv loaded.csv --mass 1 --centre 0,0,0 --report page.html",
        "analyze --each . --out out",
        *(
            everything(t)
            for t in (
                f"diagnose {GIVEN} --report page.html",
                "calibrate robot.xml a.csv --replicates 4 --report page.html",
                f"prune {GIVEN} --report page.html",
                "excite robot.xml --set evaluations=50 --out mine.json --report page.html",
            )
        ),
    ],
)
def test_a_terminal_shows_no_number_column_or_next_line_that_the_page_has_not(
    typed, folder, monkeypatch
):
    if "result.json" in typed:
        call(shlex.split("analyze robot.xml a.csv --set replicates=0 --json result.json"))
    shown = []
    monkeypatch.setattr(common, "print_table", lambda t, rows, *_: shown.append(t.brief(rows)))
    said = call([*shlex.split(typed), "-v"])
    page = (folder / ("page.html" if "page" in typed else "out/index.html")).read_text()
    cells = Cells()
    cells.feed(page)
    texts = {words(text) for text in cells.texts}
    assert shown
    for table in shown:
        for text in (*(c.title for c in table.columns), *(c.text for r in table.rows for c in r)):
            assert any(words(text) in known for known in texts), text
    told = re.findall(r"^Next .*?: (identifiability .*)$", said, re.MULTILINE)
    copied = re.findall('data-copy="(identifiability [^"]*)"', page)
    assert told == [html.unescape(line) for line in copied[:1]]


def test_the_line_that_a_new_study_begins_with_works_where_it_says(folder, monkeypatch):
    said = call(["new", "mine", "--robot", "robot.xml"])
    study, line = re.search(r"Begin with: cd (\S+) && identifiability (.*)", said).groups()
    monkeypatch.chdir(folder / study)
    call(shlex.split(line))


def test_what_the_sidecar_says_of_logs_is_not_said_again(load_text, two_link):
    stated = 'angles = "deg"\n[columns]\na1 = "shoulder"\n'
    robot = load_text(two_link.path.read_text(), sidecar=stated)
    assert reading_options(robot) == ""
    told = reading_options(Robot.load(robot.path, columns={"a2": "elbow"}, time_unit="ms"))
    assert told == " --map a2=elbow --set time_unit=ms"
