"""Joints that something outside the robot holds are found, and are no data there."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import inspect, predict
from identifiability.foundation.runs import quiet
from identifiability.servos import file_shares
from identifiability.servos.contacts import fit_unblocked, leave_out_blocked
from identifiability.servos.positions import are_aside

from .made_servos import TRUTH, load_arm, read, servos

STICKY = {**TRUTH, "shoulder.Fc": 24.0, "elbow.Fc": 9.0}
TIMES = np.arange(0.0, 19.0, 0.01)
TURNS = 2 * np.pi * TIMES
#: The elbow touches an object in the second half.
OFTEN = np.clip(1.6 * np.sin(0.25 * TURNS) + 0.3 * np.sin(0.9 * TURNS), -1, 1)
OFTEN *= np.clip(0.3 + 0.2 * (TIMES - 9.0), 0.3, 1.0)
#: It opens, and holds the object from then on.
ONCE = np.interp(TIMES, [2, 4, 5, 7], [0, -1, -1, 0.8]) + 0.1 * np.sin(0.5 * TURNS)
#: It moves so fast that it stays as far behind its command as the object holds it.
FAST = np.interp(TIMES % 3, [0, 0.5, 2, 2.5], [-1, 1, 1, -1])


def record(folder, elbow, held_at=0.0):
    """Return the arm and a log of slow motion, maybe with an object at some angle of the elbow."""
    arm = load_arm(folder)
    how = servos.Recorder(100.0, 100.0)
    shoulder = np.clip(1.6 * np.sin(0.32 * TURNS + 1.0) + 0.3 * np.sin(1.1 * TURNS), -1, 1)
    commands = 0.3 * np.transpose([shoulder, elbow])
    fault = servos.Fault(1, "object", held_at)
    frame = servos.record(arm, STICKY, commands, 18.0, how, default_rng(1), fault=fault)
    return arm, read(arm, frame)


def test_a_joint_on_an_object_is_found_and_its_rows_are_no_data(tmp_path):
    arm, log = record(tmp_path, OFTEN, 0.1)
    found = fit_unblocked(arm, [log], file_shares(arm), quiet, None)
    assert found.errors[1] < 0.01  # .055 with these rows
    rolled = predict(arm, arm, log, forward=True)
    assert rolled.runs[0].errors[1] < 0.03  # .069 with these rows
    for said in (rolled.hints[0], inspect(arm, log).hints[0]):
        assert "hold elbow for" in said
    rows = np.zeros(log.q.shape, bool)
    rows[100:200] = True  # lost, and equal, as where a joint stands at its command
    alike = replace(log, q_ref=np.where(rows, log.q, log.q_ref), unmeasured=rows)
    assert not are_aside(alike).any()


@pytest.mark.parametrize("elbow", [OFTEN, ONCE, FAST])
def test_an_object_holds_a_joint_and_friction_does_not(tmp_path, elbow):
    arm, free = record(tmp_path, elbow)
    assert not leave_out_blocked(arm, STICKY, [free])[1]
    (said,) = leave_out_blocked(arm, STICKY, [record(tmp_path, elbow, 0.1)[1]])[1]
    assert ("--map elbow.cmd=left_out" in said) == (elbow is not OFTEN)
