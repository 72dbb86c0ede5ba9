"""Cases of parametrized tests that `make test` leaves out."""

import pytest


def everything(*values):
    """Return a case that only `make check-all` runs."""
    return pytest.param(*values, marks=pytest.mark.everything)
