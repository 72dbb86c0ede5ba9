"""Logs with nothing to explain: every verb says so alike, in words, table, JSON and page."""

import html
import json
import re

import pytest
from numpy.random import default_rng

from identifiability import analyze, diagnose, export, prune
from identifiability.foundation.wording import in_python

STILL = "the robot does not move in these logs"
FLAT = "the measured torque never changes in these logs"
WORSE = "no model predicts motion that it has not seen better than a constant torque would"


def spoil(frame, case):
    """Return a log of the two-link arm about nothing, or about half of it."""
    out = frame.copy()
    tau = [c for c in frame if c.endswith(".tau")]
    if case == "rest":
        for c in frame.columns[1:]:
            out[c] = {"q": 0.3, "tau": 5.0}.get(c.rpartition(".")[2], 0.0)
    elif case == "rest, noisy torque":
        out = spoil(frame, "rest")
        out[tau] += default_rng(0).standard_normal((len(frame), 2))
    elif case == "constant":
        out[tau] = [5.0, -2.0]
    elif case == "noise":
        out[tau] = default_rng(1).standard_normal((len(frame), 2))
    return out


SILENT = {"rest": STILL, "rest, noisy torque": STILL, "constant": FLAT}


@pytest.fixture
def arm(simulated):
    """A noisy log that is long enough to be diagnosed."""
    frame = simulated("two-link", "a", samples=600).to_frame()
    return lambda case: spoil(frame, case)


def words(result, path):
    text = result.write_report(path).read_text()
    text = re.sub(r"<(script|style)\b.*?</\1>", " ", text, flags=re.DOTALL)
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]+>", " ", text)))


def check_words(text):
    """No number that is none, and no percentage in powers of ten or beyond belief."""
    for wrong in (
        r"\bnan\b",
        r"\binf\b",
        r"e[+-]\d+ ± ?\S* ?%",
        r"\d[eE][+-]?\d+ %",
        r"(?<![\d.])\d{5,}(\.\d+)? %",
    ):
        found = re.search(f".{{0,60}}(?:{wrong}).{{0,20}}", text, flags=re.IGNORECASE)
        assert found is None, found.group()


def check_numbers(content):
    """JSON holds numbers or null."""
    text = json.dumps(content)
    assert "NaN" not in text
    assert "Infinity" not in text


@pytest.mark.parametrize(
    "verb, options",
    [(analyze, {"replicates": 20, "posterior": True}), (prune, {"replicates": 10})],
)
def test_a_result_about_nothing_says_the_same_everywhere(verb, options, arm, tmp_path):
    out = verb("two-link", arm("noise"), **options)
    content = json.loads(out.to_json(tmp_path / "out.json").read_text())
    page = words(out, tmp_path / "out.html")
    assert f"Nothing is identifiable, because {WORSE}." in out.details
    assert in_python(content["statement"]) == out.statement
    assert content["nothing"] == WORSE
    assert WORSE in page
    assert verb is analyze or "use none of the 13 parameters" in page
    assert {m["identifiable"] for m in content["models"]} == {0}
    rows = content["parameters"] + content["full_parameters"]
    assert {r["verdict"] for r in rows} == {"not identifiable"}
    if verb is analyze:
        assert set(out.to_frame()["verdict"]) == {"not identifiable"}
        assert {r["reason"] for r in rows} == {f"{WORSE.capitalize()}."}
    check_words(page)
    check_words(out.statement)
    check_numbers(content)


@pytest.mark.parametrize("case", SILENT)
@pytest.mark.parametrize(
    "done, verb", [("analyzed", analyze), ("pruned", prune), ("diagnosed", diagnose)]
)
def test_what_needs_a_signal_refuses_with_the_same_reason(case, done, verb, arm, rejected):
    sentence = f"^Nothing can be {done}, because {SILENT[case]} "
    with rejected(sentence):
        verb("two-link", arm(case))


def test_a_result_about_nothing_is_not_exported(arm, tmp_path, rejected):
    found = analyze("two-link", arm("noise"), replicates=20)
    sentence = f"^Nothing can be exported, because {WORSE} "
    with rejected(sentence):
        export("two-link", found, tmp_path / "out.xml")
