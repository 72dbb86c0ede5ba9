"""Logs are known by the path that was given: none is lost, and what is proposed runs as it is."""

import html
import json
import re
import shlex
from itertools import pairwise

import pytest

from identifiability import Log
from identifiability.foundation.names import shorten_paths

from ..marks import everything
from ..test_next_lines import call

ROBOT = "my arm/two link.xml"

#: Fitted and held-out logs.
EQUAL_NAMES = (["x/run.csv", "y/run.csv"], ["the z/run.csv", "w/run.csv"])
BAGS = (["bag1:/joint_states", "bag2:/joint_states"], ["bag3:/joint_states"])
APART = (["run.csv", "x/run.csv"], [])


@pytest.fixture
def folder(tmp_path, simulated, states, write_bag, monkeypatch, two_link):
    """A folder with a robot and logs of equal names, in which one is."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my arm").mkdir()
    (tmp_path / ROBOT).write_bytes(two_link.path.read_bytes())
    names = ["run.csv", *EQUAL_NAMES[0], *EQUAL_NAMES[1], "bag1", "bag2", "bag3"]
    for seed, name in enumerate(names):
        log = simulated("two-link", "ab"[seed % 2], seed=seed, samples=200)
        if name.startswith("bag"):
            frame = log.to_frame()
            other = [f"{j}.tau" for j in log.joints]
            without = frame.drop(columns=other)
            topics = {"/a": states(without, log.joints), "/joint_states": states(frame, log.joints)}
            write_bag(topics, name=name)
        else:
            (tmp_path / name).parent.mkdir(exist_ok=True)
            log.write(tmp_path / name)
    return tmp_path


@pytest.mark.parametrize(
    "logs",
    [BAGS, *(everything(x) for x in (EQUAL_NAMES, APART))],
)
def test_every_log_counts_and_what_is_proposed_runs_as_it_is_printed(logs, folder):
    fitted, held = logs
    judged = [word for path in held for word in ("--validate", path)]
    written = ["--report", "page.html", "--json", "result.json"]
    said = call(["analyze", ROBOT, *fitted, *judged, *written])
    if not held:  # the last of several is held out, and proposed lines say so
        fitted, held = fitted[:-1], fitted[-1:]
    told = json.loads((folder / "result.json").read_text())
    assert [row["log"] for row in told["errors"]["logs"]] == [*fitted, *held]
    assert {f"sha256 {path}" for path in (*fitted, *held)} <= told["provenance"].keys()
    page = (folder / "page.html").read_text()
    assert all(f">{x}<" in page for x in shorten_paths([*fitted, *held]))
    copied = [html.unescape(x) for x in re.findall('data-copy="identifiability ([^"]*)"', page)]
    assert re.findall(r"^Next .*?: identifiability (.*)$", said, re.MULTILINE) == copied[:1]
    before = (folder / "result.json").read_bytes()
    for line in copied:
        words = shlex.split(line)
        assert words[1] == ROBOT
        if words[0] in ("analyze", "prune", "diagnose"):
            assert words[2 : 2 + len(fitted)] == fitted
            assert [b for a, b in pairwise(words) if a == "--validate"] == held
        call(words)
    assert (folder / "result.json").read_bytes() == before


def test_the_topic_that_has_effort_is_proposed_where_it_is(folder, command):
    done = command("analyze", ROBOT, folder / "bag1")
    (proposed,) = re.findall(r"name one of them as '(.*)'", done.output)
    assert proposed == f"{folder / 'bag1'}:/joint_states"
    assert len(Log.read(proposed)) == 200


def test_what_was_written_is_not_proposed_again(folder):
    call(["analyze", ROBOT, "run.csv", "--json", "result.json"])
    line = ["predict", ROBOT, "result.json", "x/run.csv"]
    assert re.search("^Next .*identifiability predict ", call(line), re.MULTILINE)
    said = call([*line, "--out", "torque.csv"])
    assert not re.search("^Next .*identifiability predict ", said, re.MULTILINE)
