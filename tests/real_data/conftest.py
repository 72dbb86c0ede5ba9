"""Studies are scripts beside the package; their data are in a folder of their own."""

import importlib
import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture(scope="session")
def study():
    """A function name -> study module."""
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module
    sys.path.remove(str(STUDIES))


@pytest.fixture(scope="session")
def data(study):
    """A function name -> data folder; without the data the test is skipped, in CI it fails."""

    def find(name):
        shared = study("shared")
        folder = shared.data_folder(name)
        if not folder.is_dir():
            pytest.skip(f"no data in {folder}; set {shared.VARIABLE}")
        return folder

    return find
