"""Many robots at once: one table, a page each; what is finished is kept, failures are sentences."""

import json
import re
import shutil
from pathlib import Path

import pytest

from identifiability import analyze_many
from identifiability.foundation.engines import Processes, Serial
from identifiability.workflows import many as module

MODEL = Path(__file__).resolve().parents[1] / "models/two-link" / "robot.xml"

OPTIONS = {"replicates": 20, "seed": 1}


@pytest.fixture(scope="module")
def start(tmp_path_factory, simulated_session):
    """A folder with the folders of three robots, one of which has no logs."""
    folder = tmp_path_factory.mktemp("fleet")
    for k, name in enumerate("abc"):
        place = folder / name
        place.mkdir()
        shutil.copy(MODEL, place)
        if name != "c":
            for log, seed in {"1": k, "2": 9 + k}.items():
                motion = "ab"[int(log) - 1]
                session = simulated_session("two-link", motion, seed, samples=300)
                session.write(place / f"run{log}.csv")
    return folder


def ask(start, out, engine, names="abc", **options):
    robots = [start / name for name in names]
    return analyze_many(robots, out, engine=engine, **{**OPTIONS, **options})


def written(out):
    """The table and the answers in a folder; pages say when they were made."""
    files = [p for p in out.rglob("*") if p.suffix in (".csv", ".json")]
    return {p.relative_to(out): p.read_bytes() for p in files}


@pytest.fixture(scope="module")
def asked(start, command, tmp_path_factory):
    """What the command printed, and the folder of its answers."""
    out = tmp_path_factory.mktemp("out") / "results"
    words = [w for name in "abc" for w in ("--each", start / name)]
    more = ["--out", out, "--set", "replicates=20", "--seed", "1", "--set", "workers=1"]
    return command("analyze", *words, *more), out


def test_one_row_a_robot_and_a_page_each(asked):
    run, out = asked
    assert run.exit_code == 1
    assert "2 of 3 robots have an answer. c has none: " in " ".join(run.stdout.split())
    told = json.loads((out / "table.json").read_text())
    rows = {row["robot"]: row for row in told["robots"]}
    assert told["schema"] == "identifiability/fleet/1"
    assert list(rows) == ["a", "b", "c"]
    for name in "ab":
        row = rows[name]
        own = json.loads((out / "robots" / f"{name}.json").read_text())
        verdicts = [p["verdict"] for p in own["parameters"]]
        assert row["verdicts"] == {kind: verdicts.count(kind) for kind in set(verdicts)}
        assert (row["model"], row["warnings"]) == (own["selected"], own["hints"])
        assert (row["logs"], row["held"]) == (["run1.csv"], ["run2.csv"])
        assert 0.01 < row["error_unseen"] < 0.2
    assert rows["c"]["failed"].endswith("or logs of another known format into it.")
    links = re.findall(r'<a href="(robots/[^"]*)"', (out / "index.html").read_text())
    assert links == ["robots/a.html", "robots/b.html"]
    assert all((out / link).stat().st_size > 100_000 for link in links)
    header, *lines = (out / "table.csv").read_text().splitlines()
    assert header.startswith("robot,logs,held,model,parameters,error,error_unseen,")
    assert len(lines) == 3


def test_several_processes_write_the_same(asked, start, tmp_path):
    with Processes(2) as engine:
        ask(start, tmp_path / "results", engine)
    assert written(tmp_path / "results") == written(asked[1])


def test_what_goes_wrong_with_one_robot_is_the_sentence_of_its_row(start, tmp_path, monkeypatch):
    (tmp_path / "two").mkdir()
    for name in ("x.urdf", "y.urdf"):
        (tmp_path / "two" / name).write_text("")

    def broken(*_, **__):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(module, "_check_options", lambda verb, given: None)
    monkeypatch.setitem(module.VERBS, "analyze", broken)
    robots = [start / "a", tmp_path / "nowhere", tmp_path / "two"]
    told = [r["failed"] for r in analyze_many(robots, tmp_path / "out", engine=Serial()).rows]
    assert told[0].endswith("please report it: ZeroDivisionError: by zero.")
    assert "There is no folder" in told[1]
    assert "has x.urdf, y.urdf; there must be one robot.urdf" in told[2]


@pytest.mark.parametrize(
    "robots, options, sentence",
    [
        (["a/x", "b/x"], {}, "Two robots are called 'x'"),
        (["a"], {"verb": "prune", "replicats": 2}, "'replicats' is no option of prune, did you"),
    ],
)
def test_what_cannot_be_asked_is_one_sentence(robots, options, sentence, tmp_path, rejected):
    with rejected(re.escape(sentence)):
        analyze_many(robots, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
