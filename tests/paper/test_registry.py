"""Every study stands in the registry, and runs in short as it says there."""

import os
import re
import sys
from pathlib import Path

import pytest
from registry import STUDIES
from shared import VARIABLE, data_folder

FOLDER = Path(__file__).resolve().parents[2] / "studies"


def test_no_study_is_outside_the_registry_and_there_are_not_more():
    texts = {p.stem: p.read_text() for p in FOLDER.glob("*.py")}
    written = {
        name for name, text in texts.items() if "study_parser(" in text or "run_script(" in text
    }
    run = {name for name, text in texts.items() if '__name__ == "__main__"' in text}
    named = {study.module for study in STUDIES}
    assert written - {"shared"} <= named
    assert run - {"__main__"} == named
    assert len(STUDIES) == len({study.name for study in STUDIES}) <= 31


def test_every_study_has_one_sentence_and_names_of_its_own():
    names = [name for study in STUDIES for name in (study.name, *study.words)]
    assert len(names) == len(set(names))
    for study in STUDIES:
        assert study.asks.endswith("?")
        assert study.asks.count("?") == 1


def test_the_library_finds_studies_without_a_path(tmp_path, process):
    """Run outside of the checkout, or inside where the package is installed elsewhere."""
    where = tmp_path if FOLDER.with_name("identifiability").exists() else FOLDER
    words = ["-m", "identifiability", "paper", "slips", "--quick", "--out", str(tmp_path)]
    env = os.environ | {"PYTHONPATH": str(FOLDER.parent)}
    done = process([sys.executable, *words], cwd=where, env=env)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "paper_slips.html").stat().st_size > 10_000


@pytest.mark.everything
@pytest.mark.parametrize("study", STUDIES, ids=lambda s: s.name)
def test_a_study_runs_in_short_and_writes_its_page(study, tmp_path, process):
    if study.data and not data_folder(study.data).is_dir():
        pytest.skip(f"no data in {data_folder(study.data)}; set {VARIABLE}")
    words = [sys.executable, FOLDER, study.name, "--quick", "--workers", "1", "--out", tmp_path]
    env = os.environ | {"PYTHONPATH": str(FOLDER.parent)}
    done = process(words, env=env)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / f"{study.name}.html").read_text()
    assert "<h1>" in page
    assert len(page) > 10_000
    assert not re.search(r'(src|href)="https?:', page)
    assert (tmp_path / "index.html").exists()
