"""Names and paths may hold anything: nothing in them runs, and no written file breaks."""

import base64
import hashlib
import json
import os
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from types import SimpleNamespace

import pytest

from identifiability import Noise, Robot, new_study

from .conftest import invoke, load, shipped_log
from .marks import everything

#: Writes the file `hit` if a shell or Python runs it.
SHELL = "$(touch hit)`touch hit`;touch hit;#"
PYTHON = '"""\'; __import__("os").system("touch hit"); """'
MARKUP = '</script></svg><script>alert(1)</script><img src=x onerror="alert(1)">'

#: Names of the two joints of a robot.
NAMES = [
    ("-rf", PYTHON),
    (SHELL, 'it\'s \\ "a"\n--> b]]>\r:x: $a$ $b$'),
    (MARKUP, "{file} {{ 7 + 7 }} %s\u2028\x85\u202e"),
]

#: A robot, two logs and a result.
ROBOT = "-rf $(touch hit)`touch hit`\n<b>.xml"
LOG, HELD_OUT, RESULT = "-a;touch hit;#.parquet", "b'`touch hit`\n{file}*?.parquet", "-r$(id).json"

#: Words without a letter that a shell or a page acts on.
PLAIN = re.compile(r"[\w./:=,-]+", re.ASCII)

#: Elements that may load something or take input elsewhere.
FOREIGN = {"img", "iframe", "object", "embed", "base", "form", "foreignobject", "frame"}


def escaped(name):
    """Return a name as an attribute of XML holds it."""
    return ET.tostring(ET.Element("x", name=name), "unicode").partition('"')[2].rpartition('"')[0]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    place = tmp_path / "work"
    place.mkdir()
    monkeypatch.chdir(place)
    return place


def hostile_robot(folder, joints):
    """Write the two-link arm under other names."""
    text = Robot.load("two-link").path.read_text()
    first, second = joints
    new = {"shoulder": first, "elbow": second, "link1": f"{first}x", "link2": f"{second}y"}
    for old, name in {**new, "two-link": f"{first}z"}.items():
        text = text.replace(f'"{old}"', f'"{escaped(name)}"')
    path = folder / ROBOT
    path.write_text(text, encoding="utf-8", newline="")
    title = json.dumps(f"{first} {second}")
    path.with_suffix(".toml").write_text(f"name = {title}\n")
    return Robot.load(path)


def write_logs(robot, folder):
    """Write a log to fit and one to hold out."""
    for seed, (name, motion) in enumerate(((LOG, "a"), (HELD_OUT, "b"))):
        made = {"noise": Noise(torque=0.02), "seed": seed}
        log = shipped_log(robot, motion, 300, like=load("two-link"), **made)
        log.write(folder / name)


def call(*words):
    """Run a verb in this process; return its output, or the sentence of its refusal."""
    done = invoke(*words)
    assert done.exception is None or isinstance(done.exception, SystemExit)
    if done.exit_code:
        assert done.exit_code == 2
        assert done.stderr.startswith("Error: ")
        assert done.stderr.count("\n") == 1
        return done.stderr
    return done.stdout


class Page(HTMLParser):
    """Lines to copy of a page, with checks of its elements."""

    def __init__(self, text):
        super().__init__()
        self.lines, self.tags, self.script, self.inside = [], [], "", False
        self.feed(text)
        self.close()
        (policy,) = re.findall(r"script-src '(sha256-[^']+)'", text)
        digest = hashlib.sha256(self.script.encode()).digest()
        assert policy == f"sha256-{base64.b64encode(digest).decode()}"
        assert self.tags.count("script") == 1
        assert self.tags.count("svg") == text.count("</svg>")
        assert not FOREIGN & {*self.tags}

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.inside = tag == "script"
        for name, value in attrs:
            assert not name.startswith("on"), (tag, name, value)
            assert not (value or "").strip().lower().startswith("javascript:")
            self.lines += [value] if name == "data-copy" else []

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        self.script += data if self.inside else ""


@pytest.fixture
def shell(tmp_path):
    """A function that runs a line in bash and returns what `identifiability` was called with."""
    path = tmp_path / "bin"
    calls = tmp_path / "calls"
    path.mkdir()
    fake = path / "identifiability"
    fake.write_text(f"#!/bin/bash\nprintf '%s\\0' \"$@\" $'\\x01' >> {shlex.quote(str(calls))}\n")
    fake.chmod(0o755)

    def run(line, folder):
        calls.unlink(missing_ok=True)
        where = {**os.environ, "PATH": f"{path}:{os.environ['PATH']}", "LC_ALL": "C"}
        said = {"cwd": folder, "env": where, "capture_output": True}
        done = subprocess.run(["bash", "-c", line], check=False, **said)
        assert (done.returncode, done.stderr) == (0, b""), line
        told = os.fsdecode(calls.read_bytes()).split("\0\x01\0")[:-1]
        return [call.split("\0") for call in told]

    return run


def lines_of(said, folder):
    """Return the lines that a terminal and the pages of a folder propose."""
    found = re.findall(
        r"^(?:Next .*?|Begin with): ((?:cd |identifiability ).*)$", said, re.MULTILINE
    )
    for page in folder.glob("*.html"):
        found += Page(page.read_text()).lines
        page.unlink()
    return list(dict.fromkeys(found))


def check_words(called, robot, known):
    """Check that a line gives the names of a robot as they are, and nothing else."""
    for verb, *words in called:
        assert PLAIN.fullmatch(verb)
        assert robot in words or f"./{robot}" in words
        for word in words:
            value = word.partition("=")[2] if word.startswith("--") else word.removeprefix("./")
            assert PLAIN.fullmatch(word) or value in known


def typed(body):
    """Return what somebody types, one verb after the other."""
    robot = f"./{ROBOT}"
    log = f"./{LOG}"
    held_out = HELD_OUT
    result = f"./{RESULT}"
    one = ("--set", "workers=1")
    fit = (robot, log, "--quick", *one)
    both = (robot, log, held_out)
    yield "inspect", robot, "--report", "p.html"
    yield "inspect", robot, log, "--report", "p.html"
    yield "analyze", *fit, "--validate", held_out, "--report", "p.html", "--json", result, "-v"
    yield "prune", *fit, "--report", "p.html", "--json", "prune.json", "--out", "-p.toml"
    yield "analyze", *fit, "--ladder", "./-p.toml"
    yield (
        *("diagnose", robot, log, "--validate", held_out, *one, "--report", "p.html"),
        *("--json", "diagnose.json", "--out", "model.toml"),
    )
    yield "simulate", robot, "random", "--out", "random.csv"
    yield "excite", robot, "--set", "evaluations=20", *one, "--out", "m.json", "--report", "p.html"
    yield "predict", robot, result, held_out, "--out", "torque.parquet", "--report", "p.html"
    yield "export", robot, result, "--out", "fitted.xml"
    yield "export", robot, result, "--out", "fitted.urdf"
    yield "export", robot, result, "--patch", "--out", "fitted.patch"
    yield "export", robot, result, "--draws", "2", "--out", "draws.csv"
    yield "export", robot, result, "--sidecar", "servo.toml", "--out", "servos.py"
    yield "calibrate", *fit, "--replicates", "4", "--report", "p.html"
    yield "payload", robot, result, held_out, "--body", body, "--report", "p.html"
    yield "payload", *both, "--mass", "1", "--centre", "0,0,0", "--body", body, "--report", "p.html"
    yield "compare", *both, "--report", "p.html"


@pytest.mark.parametrize(
    "joints",
    [
        NAMES[0],
        everything(NAMES[1]),
        pytest.param(NAMES[2], marks=pytest.mark.pictures),
    ],
)
def test_names_run_nowhere_and_break_nothing(joints, tmp_path, folder, shell, monkeypatch):
    robot = hostile_robot(folder, joints)
    assert robot.joints == joints
    write_logs(robot, folder)
    gains = "[servo]\nkp = 100\nkv = 10\n"
    (folder / "servo.toml").write_text(f"name = {json.dumps(PYTHON)}\n{gains}")
    known = {ROBOT, LOG, HELD_OUT, RESULT, *robot.bodies, "-p.toml", "<b>"}
    ran = 0
    for words in typed(robot.bodies[1]):
        for line in lines_of(call(*words), folder):
            check_words(shell(line, folder), ROBOT, known)
            ran += 1
    assert ran > 12
    check_files(folder, robot, monkeypatch)
    assert not [*tmp_path.rglob("hit")]


def check_files(folder, robot, monkeypatch):
    """Read what verbs wrote; names that a format cannot hold were refused."""
    assert json.loads((folder / RESULT).read_text())["full_parameters"]
    for name in ("-p.toml", "model.toml"):
        assert tomllib.loads((folder / name).read_text())["models"]
    made = ET.parse(folder / "fitted.xml").getroot()
    assert {*robot.joints} <= {joint.get("name") for joint in made.iter("joint")}
    assert Robot.load(folder / "fitted.xml").joints == robot.joints
    urdf = folder / "fitted.urdf"
    if urdf.exists():
        assert Robot.load(urdf).joints == robot.joints
        assert tomllib.loads(urdf.with_suffix(".toml").read_text())["name"] == robot.title
    patch = (folder / "fitted.patch").read_text().split("\n")
    assert sum(line.startswith(("--- ", "+++ ")) for line in patch) in (2, 4)  # and a sidecar
    assert all(line[:1] in ("", "-", "+", " ", "@", "\\") for line in patch)
    told = {}
    actuators = SimpleNamespace(DelayedPDActuatorCfg=lambda **given: told.update(given))
    monkeypatch.setitem(sys.modules, "isaaclab", SimpleNamespace(actuators=actuators))
    monkeypatch.setitem(sys.modules, "isaaclab.actuators", actuators)
    assert runpy.run_path(str(folder / "servos.py"))["ROBOT"] == PYTHON
    for k, joint in enumerate(robot.joints):
        fits = [bool(re.fullmatch(name, joint)) for name in told["stiffness"]]
        assert fits == [k == 0, k == 1]


def test_a_new_study_runs_what_it_was_given_and_nothing_else(tmp_path, folder, shell, monkeypatch):
    write_logs(hostile_robot(folder, NAMES[1]), folder)
    said = call(
        "new", "--robot", f"./{ROBOT}", f"./-s {SHELL.replace('/', '')}", f"./{LOG}", HELD_OUT
    )
    (line,) = lines_of(said, folder)
    ((verb, *words),) = shell(line, folder)
    assert [verb, *words] == ["analyze", "--report", "report.html"]
    made = folder / f"-s {SHELL}"
    assert tomllib.loads(made.joinpath(ROBOT).with_suffix(".toml").read_text())
    check_script(made / "study.py", made / f"../{LOG}", made / f"../{HELD_OUT}", monkeypatch)
    empty = new_study("empty", f"./{ROBOT}")
    written = tomllib.loads(empty.folder.joinpath(ROBOT).with_suffix(".toml").read_text())
    assert written["name"] == " ".join(NAMES[1])
    assert not (made / "Makefile").exists()
    assert not [*tmp_path.rglob("hit")]


def check_script(path, fitted, held_out, monkeypatch):
    """Run the script of a study with verbs that do nothing."""
    seen = {}

    def fit(case, *, ladder=None):
        seen.update(case=case, ladder=ladder)
        return SimpleNamespace(write_report=str, write_model=str, to_json=str)

    def export(robot, result, out):
        return SimpleNamespace(robot=(robot, result, out))

    with monkeypatch.context() as patch:
        for name, stub in {"analyze": fit, "diagnose": fit, "export": export}.items():
            patch.setattr(f"identifiability.{name}", stub)
        runpy.run_path(str(path), run_name="__main__")
    assert len(path.read_text().splitlines()) <= 10
    case = seen["case"]
    assert case.robot.path == path.with_name(ROBOT)
    assert (case.logs, case.validate) == ((str(fitted),), (str(held_out),))
    assert seen["ladder"] == "model.toml"


@pytest.mark.parametrize(
    "lost, option, word",
    [
        ({"t": "time;touch hit"}, "--map", "time;touch hit=t"),
        ({";id;#.q": "*[`id`]", ";id;#.tau": "b"}, "--map", "OLD=;id;#.q"),
        ({";id;#.q": "*[`id`]", ";id;#.tau": "b"}, "--lock", ";id;#"),
        ({"-rf $(id).q": "*[`id`]", "-rf $(id).tau": "b"}, "--lock", "-rf $(id)"),
        ({";id;#.tau": ";id;#.tau [quux]"}, "--map", ";id;#.tau [quux]=;id;#.tau [Nm]"),
    ],
)
def test_a_hint_quotes_what_it_says_to_type(lost, option, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    robot = hostile_robot(tmp_path, ("-rf $(id)", ";id;#"))
    log = shipped_log(robot, "a", 300, like=load("two-link")).to_frame()
    log.rename(columns=lost).to_csv("log.csv", index=False)
    sentence = call("inspect", f"./{ROBOT}", "log.csv")
    typed = re.findall(rf"{option}[ =]('[^']*')", sentence)
    assert word in [text for words in typed for text in shlex.split(words)], sentence
    for gain in re.findall(r"gain = {.*?}", sentence):
        assert tomllib.loads(gain.replace("…", "1")) == {"gain": {";id;#": 1}}


@pytest.mark.parametrize("name", ["*", "?", "wrist_*"])
def test_a_name_that_is_a_pattern_is_refused_with_one_sentence(name, tmp_path, rejected):
    with rejected("stand for other letters in names"):
        hostile_robot(tmp_path, ("a", name))


@pytest.mark.parametrize(
    "name, sentence",
    [("a\x00", "control characters"), ("$(id)", "xacro would compute"), (MARKUP, ""), ("a-->", "")],
)
def test_a_table_of_names_becomes_a_file_with_these_names(name, sentence, tmp_path):
    table = tmp_path / "--> table.toml"
    made = tmp_path / "made"
    link = {"name": name, "joint": f"{name}j", "a": 0.5}
    rows = "\n".join(f"{key} = {json.dumps(value)}" for key, value in link.items())
    table.write_text(f'convention = "standard"\n[[links]]\n{rows}\n')
    said = call("new", made, "--robot", table)
    if sentence:
        assert sentence in said
        assert not made.exists()
    else:
        assert Robot.load(made / "robot.urdf").joints == (f"{name}j",)


def test_a_path_that_is_no_utf_8_is_copied_to_the_byte(folder, shell, two_link):
    name = os.fsdecode(b"a\xff\n.xml")
    (folder / name).write_bytes(two_link.path.read_bytes())
    said = call("inspect", name, "--report", "p.html", "--json", "p.json")
    for line in lines_of(said, folder):
        for called in shell(line, folder):
            assert name in called
    assert json.loads((folder / "p.json").read_text())


def test_a_sidecar_names_nothing_that_runs_code(tmp_path, two_link):
    path = tmp_path / "arm.xml"
    path.write_bytes(two_link.path.read_bytes())
    path.with_suffix(".toml").write_text('[run]\nscheduler = "work"\n')
    log = tmp_path / "log.csv"
    log.write_text("t\n")
    assert "type --set scheduler=" in call("analyze", path, log, "--quick")


def test_an_installed_package_registers_nothing(tmp_path, process):
    """Only `--plugin` runs a file."""
    groups = ("identifiability", "identifiability.effects", "identifiability.plugins")
    installed = tmp_path / "evil-1.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1\n")
    entries = "\n".join(f"[{group}]\nevil = evil:run\n" for group in groups)
    (installed / "entry_points.txt").write_text(entries)
    (tmp_path / "evil.py").write_text("open('hit', 'w')\n")
    where = {**os.environ, "PYTHONPATH": str(tmp_path)}
    words = [sys.executable, "-m", "identifiability", "inspect", "two-link"]
    process(words, check=True, cwd=tmp_path, env=where)
    assert not (tmp_path / "hit").exists()
