"""What is no longer needed is freed at once, without the collector of reference cycles."""

import gc
import sys
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, analyze, diagnose

#: Bytes of an object's arrays from which it counts as large.
LARGE = 10_000

THRESHOLDS = """
import gc, sys
from contextlib import suppress
from identifiability.__main__ import main
before = gc.get_threshold()
sys.argv = ["identifiability", "inspect", "two-link"]
with suppress(SystemExit):
    main()
assert gc.isenabled() and gc.get_threshold() == before
"""


@pytest.fixture
def garbage():
    """A function that returns the large objects of the package that a call leaves to gc."""

    def size(x):
        return sum(y.nbytes for y in gc.get_referents(x) if isinstance(y, np.ndarray))

    def of(call):
        call()  # the first imports modules, some of which leave cycles
        gc.collect()
        gc.disable()
        gc.set_debug(gc.DEBUG_SAVEALL)
        try:
            result = call()
            gc.collect()
            own = [x for x in gc.garbage if type(x).__module__.startswith("identifiability")]
            large = sorted({type(x).__name__ for x in own if size(vars(x)) > LARGE})
        finally:
            gc.set_debug(0)
            gc.garbage.clear()
            gc.enable()
        assert result is not None
        return large

    return of


@pytest.mark.parametrize("verb", [analyze, diagnose])
def test_no_large_object_waits_for_the_collector(verb, garbage, simulated_session):
    logs = [
        simulated_session("two-link", name, k, Noise(torque=0.02)) for k, name in enumerate("ab")
    ]
    reversed_logs = [replace(log, tau=log.tau * [1.0, -1.0]) for log in logs]

    def run():
        return verb("two-link", reversed_logs[0], reversed_logs[1], quick=True)

    assert "wrong sign" in run().hints[0]
    assert garbage(run) == []


def test_the_command_line_leaves_the_collector_as_python_has_it(process):
    process([sys.executable, "-c", THRESHOLDS], check=True)
