"""The studies stand beside the package; tests import them from there."""

import runpy
import shutil
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ROOT / "studies"
if str(STUDIES) not in sys.path:
    sys.path.insert(0, str(STUDIES))


@pytest.fixture
def changed_robot(tmp_path):
    """A function (file, old text, new text) -> path of a copy of the 3-RPS robot so changed."""

    def change(name, old, new):
        folder = tmp_path / "3-rps"
        shutil.copytree(ROOT / "models" / "3-rps", folder)
        path = folder / name
        text = path.read_text(encoding="utf-8")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), encoding="utf-8")
        if name == "make_robot.py":
            runpy.run_path(str(path), run_name="__main__")
        return str(folder / "robot.xml")

    return change
