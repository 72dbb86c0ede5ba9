"""Results show themselves in a notebook, and what comes from files cannot run there."""

import json
import re
from html import escape, unescape
from html.parser import HTMLParser
from pathlib import Path

import pytest
from IPython.core.interactiveshell import InteractiveShell
from IPython.utils.capture import capture_output
from traitlets.config import Config

import identifiability
from identifiability import analyze, calibrate, compare, diagnose, inspect, prune
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.wording import at_terminal, in_python
from identifiability.report.answers.python_lines import python_lines
from identifiability.report.results import answer_first


class Tags(HTMLParser):
    """Collects the tags of a text, and that they close."""

    def __init__(self, text):
        super().__init__()
        self.found = set()
        self.open = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.found.add(tag)
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def results(simulated_session):
    log = simulated_session("two-link", "a", samples=500)
    analysis = analyze("two-link", log, replicates=20)
    return {
        "analysis": analysis,
        "calibration": calibrate(analysis, replicates=8, refits=20),
        "ladder": prune("two-link", log, replicates=4),
        "diagnosis": diagnose("two-link", log, effects=["torque_offset"], quick=True),
    }


@pytest.mark.parametrize("kind", ["analysis", "calibration", "ladder", "diagnosis"])
def test_a_result_is_what_its_page_answers_first_and_a_table(kind, results):
    html = results[kind]._repr_html_()
    tags = Tags(html)
    assert {"dl", "table"} <= tags.found
    assert not tags.open
    first = answer_first(results[kind])
    assert all(escape(answer.question) in html for answer in first.answers)
    assert ("svg" in tags.found) == bool(first.below)


def test_a_frame_has_ten_columns_and_details_the_rest(results, simulated_session):
    logs = [simulated_session("two-link", name, samples=500) for name in "ab"]
    others = [inspect("two-link", logs), compare("two-link", *logs)]
    for result in (*results.values(), *others, results["analysis"].predict(logs[1])):
        frame = result.to_frame()
        every = result.to_frame(details=True)
        assert len(frame.columns) <= 10
        assert len(every.columns) >= len(frame.columns)
        assert len([name for name in dir(result) if name[0] != "_"]) <= 20


@pytest.mark.parametrize("kind", ["robot", "log", "base", "prediction"])
def test_what_is_not_an_answer_shows_itself_too(kind, results, simulated_session):
    analysis = results["analysis"]
    log = simulated_session("two-link", "a", samples=500)
    made = {
        "robot": lambda: analysis.robot.with_lock(["elbow=0.2"]),
        "log": lambda: log,
        "base": lambda: analysis.base,
        "prediction": lambda: analysis.predict(log),
    }[kind]()
    html = made._repr_html_()
    tags = Tags(html)
    assert tags.found & {"p", "dl"}
    assert "table" in tags.found
    assert len(html) < 60_000
    assert len(repr(made)) < 300
    if kind == "robot":
        assert "locked at 0.2" in html


@pytest.mark.pictures
def test_the_notebook_of_the_documentation_runs_and_shows_what_it_says():
    """Every cell in a shell of IPython, and what it shows, as a kernel sends it."""
    pytest.importorskip("arviz_base", reason="needs the extra 'arviz'")
    page = Path(__file__).resolve().parents[1] / "docs" / "tutorials" / "notebook.ipynb"
    cells = json.loads(page.read_text())["cells"]
    assert not any(cell.get("outputs") for cell in cells)  # what is shown is made anew
    shell = InteractiveShell(config=Config({"HistoryManager": {"enabled": False}}))
    shown = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            done = shell.run_cell(source, store_history=False)
            done.raise_error()
            shown[source.splitlines()[-1]], _ = shell.display_formatter.format(done.result)
    assert {"text/html"} < shown["result"].keys()
    assert "<table" in shown["robot"]["text/html"]
    for line in (line for line in shown if line.startswith("plot.")):
        assert shown[line]["image/png"][:4] == b"\x89PNG"
    assert "phi[link2.Iyy]" in shown["arviz_stats.summary(result.to_arviz())"]["text/html"]


@pytest.mark.parametrize(
    "line, calls",
    [
        (
            "diagnose a.urdf a.csv b.csv --validate c.csv --out model.toml",
            [
                "missing = diagnose('a.urdf', ['a.csv', 'b.csv'], validate='c.csv')",
                "missing.write_model('model.toml')",
            ],
        ),
        (
            r"analyze a.urdf a.csv --map 'j(\d)=k\1' --lock finger --set cutoff=10 --report r.html",
            [
                r"result = analyze(Robot.load('a.urdf', columns={'j(\\d)': 'k\\1'}, "
                "lock=['finger']), 'a.csv', preparation=Preparation(cutoff=10))",
                "result.write_report('r.html')",
            ],
        ),
        (
            "payload a.urdf result.json 1e5 --without 7 --mass 2.5",
            ["load = payload('a.urdf', 'result.json', '1e5', without='7', mass=2.5)"],
        ),
        (
            "export a.urdf result.json --out 'a && b.xml'",
            ["exported = export('a.urdf', 'result.json', 'a && b.xml')"],
        ),
    ],
)
def test_next_steps_of_a_notebook_are_calls_in_python(line, calls):
    found = python_lines(f"identifiability {line}")
    assert found.splitlines() == calls


def test_the_next_step_runs_on_named_tables(results, simulated_session, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    logs = {"run1": simulated_session("two-link", "a", samples=500).to_frame()}
    result = analyze("two-link", logs, replicates=0)
    assert "run1" in result.samples[0].name
    exec(result.next()[0][1], {**vars(identifiability), "robot": "two-link", "logs": logs})
    shown = unescape(results["analysis"]._repr_html_())
    shown = shown.replace("<span>", "").replace("</span>", "")
    assert "prune(robot, logs" in shown
    assert "identifiability diagnose" not in shown


def test_an_error_in_a_notebook_is_one_line_and_names_keywords():
    shell = InteractiveShell()
    log = {"t": [0, 1], "q1": [0, 1], "tau1": [0, 1]}
    with capture_output() as shown:
        shell.run_cell(f"from identifiability import analyze; analyze('two-link', {log})")
    lines = shown.stdout.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("LogError: ")
    assert "columns={'" in lines[0]
    assert "--" not in lines[0]


def test_options_in_a_sentence_become_keywords():
    said = "Type --lock 'joint_1' or --map 'OLD=joint_1.q'. Use --set cutoff=10, or --force."
    lock = "Robot.load(…, lock=['joint_1'])"
    columns = "Robot.load(…, columns={'OLD': 'joint_1.q'})"
    spoken = f"Type {lock} or {columns}. Use preparation=Preparation(cutoff=10), or force=True."
    assert in_python(said) == spoken
    assert in_python("`payload --mass 2`, --prior.") == "`payload(mass=2)`, prior=…."


def test_a_remedy_speaks_python_in_python_and_options_at_a_terminal(results):
    error = IdentifiabilityError("Give --mass.")
    assert str(error) == "Give mass=…."
    with at_terminal():
        assert str(error) == "Give --mass."
        assert "logs" in results["analysis"].next()[0][1]


def test_a_page_begins_with_the_values_of_each_joint(results, tmp_path):
    page = results["analysis"].write_report(tmp_path / "page.html").read_text()
    sections = re.findall(r'<section[^>]*id="([\w-]+)"', page)
    assert sections[0] == "values"
    own = page[page.index('id="values"') : page.index('id="prediction"')]
    verdict = results["analysis"]["elbow.Fc"]
    assert f"{verdict.estimate:.3f}"[:4] in own
    assert verdict.verdict in own
