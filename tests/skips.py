"""Report skips: all of them in one line at the end, and as failures in CI.

`tests/conftest.py` registers these hooks; `tests/test_skips.py` runs them in a process that needs
nothing else.
"""

import os
from collections import Counter

import pytest


def _fail_in_ci(report):
    """Turn a skip into a failure in CI: missing data or packages must not pass for a pass."""
    skipped = report.skipped and not hasattr(report, "wasxfail")
    if skipped and os.environ.get("CI") == "true":
        report.longrepr = f"skipped in CI: {_reason(report)}"
        report.outcome = "failed"
    return report


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    return _fail_in_ci((yield))


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Catch what skips a whole file, such as `importorskip` at its head."""
    return _fail_in_ci((yield))


def _reason(report):
    """Return why something was skipped, without the place."""
    text = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    return text.removeprefix("Skipped: ")


def pytest_terminal_summary(terminalreporter):
    """List skips in one line, each reason with its count."""
    counts = Counter(map(_reason, terminalreporter.stats.get("skipped", [])))
    if counts:
        reasons = "; ".join(f"{count} × {reason}" for reason, count in counts.items())
        terminalreporter.write_line(f"skipped: {reasons}")
