"""Data of real robots are in a folder of their own."""

import pytest
from shared import VARIABLE, data_folder


@pytest.fixture(scope="session")
def data():
    """A function name -> data folder; without the data the test is skipped, in CI it fails."""

    def find(name):
        folder = data_folder(name)
        if not folder.is_dir():
            pytest.skip(f"no data in {folder}; set {VARIABLE}")
        return folder

    return find
