"""Many robots at once: one table, a page each; what is finished is kept, failures are sentences."""

import json
import re
import shutil
from html import unescape
from pathlib import Path

import pytest
from typer.testing import CliRunner

from identifiability import Batch, batch
from identifiability.cli import app
from identifiability.foundation.engines.local import Resumed, Serial
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.workflows import batch as module
from identifiability.workflows.batch import FINISHED, Row, plan_tasks

MODEL = Path(__file__).resolve().parents[1] / "models" / "two-link" / "robot.xml"

STUDY = """
verb = "analyze"

[options]
replicates = 20
cutoff = 12

[[robots]]
each = "fleet/*"
file = "{each}/robot.xml"
train = "{each}/fit*.csv"
validate = ["{each}/unseen.csv"]

[[robots]]
name = "shipped"
file = "two-link"
train = ["fleet/a/fit1.csv", "fleet/a/f*1.csv"]
options = {cutoff = 9}
"""


@pytest.fixture(scope="module")
def start(tmp_path_factory, simulated_session):
    """A folder with three robots, one of which has no logs, and a study of them."""
    folder = tmp_path_factory.mktemp("batch")
    for k, name in enumerate("abc"):
        place = folder / "fleet" / name
        place.mkdir(parents=True)
        shutil.copy(MODEL, place)
        if name != "c":
            logs = {"fit1": ("a", k), "fit2": ("b", k), "unseen": ("a", 9 + k)}
            for log, (motion, seed) in logs.items():
                simulated_session("two-link", motion, seed, samples=300).write(place / f"{log}.csv")
    (folder / "study.toml").write_text(STUDY)
    return folder


@pytest.fixture(scope="module")
def asked(start):
    """What the command printed, and the folder of its answers."""
    out = start / "results"
    words = ["batch", str(start / "study.toml"), "--out", str(out), "--engine", "serial"]
    return CliRunner().invoke(app, words), out


@pytest.fixture
def again(start, asked, tmp_path):
    """A copy of the finished folder, and a function that asks once more into it."""
    out = shutil.copytree(asked[1], tmp_path / "results")
    return out, lambda: batch(start / "study.toml", out, engine=Serial())


def table(out):
    own = str(out).encode()  # which the page's own command names
    return [
        (out / name).read_bytes().replace(own, b"OUT")
        for name in ("table.csv", "table.json", "index.html")
    ]


def test_one_row_a_robot_and_a_page_each(asked):
    _, out = asked
    told = json.loads((out / "table.json").read_text())
    rows = {row["robot"]: row for row in told["robots"]}
    assert told["schema"] == "identifiability/batch/1"
    assert list(rows) == ["a", "b", "c", "shipped"]
    for name in ("a", "b", "shipped"):
        row = rows[name]
        own = json.loads((out / "robots" / f"{name}.json").read_text())
        verdicts = [p["verdict"] for p in own["parameters"]]
        assert row["verdicts"] == {kind: verdicts.count(kind) for kind in set(verdicts)}
        assert row["model"] == own["selected"]
        assert 0.01 < row["error_unseen"] < 0.2
        assert row["page"] == f"robots/{name}.html"
        assert row["warnings"] == own["hints"]
    assert [(rows[n]["logs"], rows[n]["held"]) for n in ("a", "shipped")] == [(2, 1), (1, 0)]
    links = re.findall(r'<a href="(robots/[^"]*)"', (out / "index.html").read_text())
    assert links == [f"robots/{n}.html" for n in ("a", "b", "shipped")]
    assert all((out / link).stat().st_size > 100_000 for link in links)
    frame = (out / "table.csv").read_text().splitlines()
    assert frame[0].startswith("robot,file,logs,held,model,parameters,identifiable,")
    assert len(frame) == 5


def test_a_robot_that_fails_is_a_sentence_and_a_code_at_the_end(asked):
    run, out = asked
    assert run.exit_code == 1
    assert "3 of 4 robots have an answer. c has none: No log in" in run.stdout
    assert "c/fit*.csv'; give another pattern." in unescape((out / "index.html").read_text())
    assert "Traceback" not in run.output


def test_what_is_finished_is_not_done_again(again, asked, monkeypatch):
    out, ask = again
    monkeypatch.setattr(module, "_function", lambda verb: pytest.fail("asked again"))
    monkeypatch.setattr(module, "_check_options", lambda verb, given, folder: dict(given))
    result = ask()
    assert (result.found, len(result.rows)) == (3, 4)
    assert table(out) == table(asked[1])


def test_what_was_interrupted_gives_the_same_table(again, asked, start):
    out, ask = again
    first, second, _ = (out / FINISHED).read_text().splitlines()
    (out / FINISHED).write_text(f"{first}\n{second[:-40]}")  # killed while it wrote
    (out / "table.csv").unlink()
    assert ask().found == 1
    assert table(out) == table(asked[1])
    (out / "robots" / "a.html").unlink()
    assert not module._is_whole(out, Row(robot="a", file="robot.xml"))


def test_ctrl_c_loses_only_what_was_under_way(start, tmp_path):
    class Interrupted(Serial):
        def _run(self, function, items):
            yield function(items[0])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(start / "study.toml", tmp_path / "out", engine=Interrupted())
    assert len((tmp_path / "out" / FINISHED).read_text().splitlines()) == 1
    assert sorted(p.name for p in (tmp_path / "out" / "robots").iterdir()) == ["a.html", "a.json"]


def test_another_log_option_or_program_is_another_question(start, monkeypatch):
    entry = module._read(start / "study.toml")[0]
    before = plan_tasks(entry, start)
    log = start / "fleet" / "b" / "fit2.csv"
    text = log.read_text()
    try:
        log.write_text(text.replace("1", "2", 1))
        changed = plan_tasks(entry, start)
    finally:
        log.write_text(text)
    assert [a == b for a, b in zip(before, changed, strict=True)] == [True, False, True, True]
    sidecar = start / "fleet" / "a" / "robot.toml"
    try:
        sidecar.write_text('name = "another"\n')
        changed = plan_tasks(entry, start)
    finally:
        sidecar.unlink()
    assert [a == b for a, b in zip(before, changed, strict=True)] == [False, True, True, True]


def test_a_fault_of_the_program_ends_no_other_robot(monkeypatch):
    task = module.Task(name="a", verb="analyze", file=str(MODEL), loaded={}, train=("x.csv",))

    def broken(*_, **__):
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(module, "_function", lambda verb: broken)
    said = module.run_task(task).row.failed
    assert said == "It met a fault of this program, please report it: ZeroDivisionError: by zero."


def write(folder, text):
    path = folder / "study.toml"
    path.write_text(text)
    return path


ONE = '[[robots]]\nfile = "two-link"\ntrain = "{log}"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "'verb': field required"),
        ('verb = "analyse"\n' + ONE, "'verb': input should be 'analyze', 'prune' or 'diagnose'"),
        ('verb = "analyze"\nrobots = []', "'robots': list should have at least 1 item"),
        (
            'verb = "analyze"\n' + ONE + 'validat = "x.csv"',
            "'robots.0.validat' is not a key that is known here, did you mean 'validate'?",
        ),
        (
            'verb = "prune"\noptions = {critrion = "best"}\n' + ONE,
            "'critrion' is no option of prune, did you mean 'criterion'? Its options are cad_prior",
        ),
        (
            'verb = "analyze"\noptions = {cutoff = "8 Hz"}\n' + ONE,
            "cutoff must be a number above 0 or None, not '8 Hz'.",
        ),
        (
            'verb = "analyze"\n[[robots]]\nfile = "tow-link"\ntrain = "{log}"',
            "There is no robot file 'tow-link', did you mean 'two-link'?",
        ),
        (
            'verb = "analyze"\n[[robots]]\nfile = "two-link"\ntrain = "nothing*.csv"',
            "is called 'nothing*.csv'; give another pattern.",
        ),
        (
            'verb = "analyze"\n[[robots]]\nfile = "two-link"\ntrain = "no.csv"',
            "There is no log file '{folder}/no.csv'; give a CSV or Parquet file.",
        ),
        (
            'verb = "analyze"\n[[robots]]\nfile = "two-link"\ntrain = []',
            "'two-link' has no logs; name them in train.",
        ),
        (
            'verb = "analyze"\n[[robots]]\neach = "none/*"\nfile = "two-link"\ntrain = "{log}"',
            "is called 'none/*' (each).",
        ),
        (
            'verb = "analyze"\n' + ONE + ONE,
            "Two robots are called 'two-link'; give each a name of its own",
        ),
        ('verb = "analyze"\n' + ONE + 'name = ".."', "'..' cannot be the name of a robot's page"),
        ('verb = analyze', "study.toml is not valid TOML: Invalid value"),
    ],
)  # fmt: skip
def test_a_study_that_cannot_be_is_one_sentence(text, sentence, start, tmp_path):
    text = text.replace("{log}", str(start / "fleet" / "a" / "fit1.csv"))
    with pytest.raises(IdentifiabilityError) as error:
        batch(write(tmp_path, text), tmp_path / "out")
    assert sentence.replace("{folder}", str(tmp_path)) in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_not_for_answers_is_one_sentence(start, tmp_path, again):
    study, taken = start / "study.toml", tmp_path / "taken"
    taken.mkdir()
    (taken / "thesis.tex").write_text("")
    with pytest.raises(IdentifiabilityError, match="is there already and no batch made it; give"):
        batch(study, taken)
    with pytest.raises(IdentifiabilityError, match=r"thesis\.tex' cannot be used: Not a directory"):
        batch(study, taken / "thesis.tex")
    assert [p.name for p in taken.iterdir()] == ["thesis.tex"]
    with pytest.raises(IdentifiabilityError, match="no file needs a folder for its answers"):
        batch({"verb": "analyze", "robots": [{"file": "two-link", "train": "x.csv"}]})
    with pytest.raises(IdentifiabilityError, match="in its own folder; leave resume out"):
        batch(study, tmp_path / "new", engine=Resumed(Serial(), tmp_path / "work"))
    out, ask = again
    with (
        module._kept(out),
        pytest.raises(IdentifiabilityError, match="Another batch is at work in"),
    ):
        ask()


def test_the_command_has_one_sentence_for_what_is_not_there(tmp_path):
    run = CliRunner().invoke(app, ["batch", str(tmp_path / "no.toml")])
    assert run.exit_code == 2
    assert run.stderr.startswith("Error: There is no study file")


def test_the_worst_is_named_first():
    rows = [Row(robot=f"r{k}", file="r.xml", error_unseen=k / 100, model="m") for k in (1, 3, 2)]
    rows.append(Row(robot="r4", file="r.xml", missing=("stribeck_friction@joint_1",)))
    told = Batch(name="fleet", verb="diagnose", folder=Path(), rows=tuple(rows)).statement
    assert "an error of 3 % to 1 % (median 2 %); the largest: r3 (3 %), r2 (2 %), r1 (1 %)" in told
    assert told.endswith("Of 1 something is missing in the model: r4.")


@pytest.mark.everything
@pytest.mark.parametrize("verb", ["prune", "diagnose"])
def test_other_verbs_have_rows_as_well(verb, start, tmp_path):
    study = {
        "verb": verb,
        "options": {"quick": True},
        "robots": [
            {
                "file": "two-link",
                "train": str(start / "fleet/a/fit*.csv"),
                "validate": str(start / "fleet/a/unseen.csv"),
            }
        ],
    }
    result = batch(study, tmp_path / "out", engine=Serial())
    (row,) = result.rows
    assert not row.failed
    assert row.error_unseen < 0.2
    assert bool(row.verdicts) == (verb == "prune")
    assert (row.error_before is not None) == (verb == "diagnose")
    assert "error_before" in result.to_frame() or verb == "prune"
    assert (tmp_path / "out" / "index.html").stat().st_size > 10_000
