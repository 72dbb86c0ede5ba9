"""What a fit keeps in memory: its imports, and its answer instead of its rows."""

import json
import subprocess
import sys

from peers.running import STUDIES, make_samples, run_contender

#: Heavy packages that a fit needs none of.
NEEDLESS = ("pandas", "pyarrow", "scipy.signal", "scipy.spatial", "scipy.stats", "matplotlib",
            "cvxpy", "emcee", "arviz_stats", "jinja2")  # fmt: skip

IMPORTS = """
import json, sys
from identifiability import (
    Log, Model, Regression, Robot, estimate, find_base_parameters, gather_information,
    prepare_samples,
)
json.dump([m for m in sys.argv[1:] if m in sys.modules], sys.stdout)
"""


def test_a_fit_imports_nothing_that_it_does_not_need():
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS, *NEEDLESS], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == []


def test_a_hundred_thousand_samples_of_the_arm_are_fitted_in_300_mb():
    with make_samples(100_000, 0) as folder:
        found = run_contender("ours", folder, 100_000, 1, 300.0)
    assert found.ran, found.why
    assert found.evidence["rank"] == 48
    assert found.peak <= 300.0, f"{found.peak:.0f} MB"


def test_what_does_not_fit_in_memory_is_not_run_and_said_so(monkeypatch):
    monkeypatch.setattr("peers.running.free_memory", lambda: 100.0)
    found = run_contender("cvxpy, all rows", STUDIES, 100_000, 1, 1.0)
    assert not found.ran
    assert "it would need about" in found.why
