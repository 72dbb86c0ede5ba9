"""How often a name is given on the user's own motion where nothing is missing."""

from identifiability import analyze
from identifiability.foundation.engines import Serial
from identifiability.workflows.calibrate.calibration import measure_false_names


def test_false_names_are_counted_on_the_users_own_motion(logs_of):
    logs = logs_of("two-link", "joint_stiffness@elbow=0.05")
    analysis = analyze("two-link", logs[:2], replicates=0)
    found = measure_false_names(analysis, 4, 0, Serial(), lambda done, total: None)
    # The spring that is in these logs is not in their repetitions; at a rate of .1 more than
    # two of four happen once in 270.
    assert found.trials == 4
    assert len(found.named) <= 2
    assert found.rate.low <= found.rate.value <= found.rate.high
    assert "4 simulated repetitions" in found.statement
