"""The study of hidden effects goes on where it was stopped."""

import importlib
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture
def study():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("hidden_effect")
    sys.path.remove(str(STUDIES))


def test_the_study_goes_on_where_it_was_stopped(study, tmp_path, monkeypatch):
    jobs = list(study.list_jobs(1, 1, ["five-bar"], ["null", "single"]))[:7]
    path = tmp_path / "hidden_effect.jsonl"
    asked = []

    def told(job):
        asked.append(job.key)
        return {"key": job.key, "outcome": "no name", "named": "", "study": job.study}

    monkeypatch.setattr(study, "_row", told)
    study.run_rest(jobs[:3], path, 1)
    with path.open("a") as file:
        file.write('{"key": "cut o')
    frame = study.run_rest(jobs, path, 1)
    assert asked == [j.key for j in jobs]
    assert frame.key.tolist() == [j.key for j in jobs]
    assert len(path.read_text().splitlines()) == 7
