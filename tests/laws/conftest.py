"""Robots of several laws."""

import pytest

from ..conftest import load


@pytest.fixture(scope="session")
def two():
    return load("two-link")


@pytest.fixture(scope="session")
def five_bar():
    return load("five-bar")
