"""The study of foreign logs stands beside the package; tests import it from there."""

import sys
from pathlib import Path

import pytest

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture(scope="session")
def study():
    """The module of the study."""
    sys.path.insert(0, str(STUDIES))
    import foreign_logs

    yield foreign_logs
    sys.path.remove(str(STUDIES))
