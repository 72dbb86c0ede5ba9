"""Joints that something outside the robot holds are found, and are no data there."""

from dataclasses import replace

import numpy as np
from numpy.random import default_rng

from identifiability import Log
from identifiability.foundation.runs import quiet
from identifiability.logs.conventions import Conventions
from identifiability.servos import file_shares
from identifiability.servos.contacts import find_blocked, fit_unblocked, state_blocked
from identifiability.servos.positions import are_aside
from identifiability.simulation.rollout import CommandedRobot

from .made_servos import TRUTH, load_arm, servos

STICKY = {**TRUTH, "shoulder.Fc": 24.0, "elbow.Fc": 9.0}


def record(arm, fault):
    """Record slow motion; the elbow touches an object in the second half, if there is one."""
    how = servos.Recorder(100.0, 100.0)
    t = np.arange(0.0, 19.0, 0.01)
    turns = 2 * np.pi * t
    shoulder = 1.6 * np.sin(0.32 * turns + 1.0) + 0.3 * np.sin(1.1 * turns)
    elbow = 1.6 * np.sin(0.25 * turns) + 0.3 * np.sin(0.9 * turns)
    commands = 0.3 * np.clip([shoulder, elbow], -1, 1)
    commands[1] *= np.clip(0.3 + 0.2 * (t - 9.0), 0.3, 1.0)
    frame = servos.record(arm, STICKY, commands.T, 18.0, how, default_rng(1), fault=fault)
    return Log.from_frame(frame, conventions=Conventions.of(arm)).select(arm.joints)


def test_a_joint_on_an_object_is_found_and_its_rows_are_no_data(tmp_path):
    arm = load_arm(tmp_path)
    log = record(arm, servos.Fault(1, "object", 0.1))
    found, aside = fit_unblocked(arm, [log], file_shares(arm), quiet, None)
    (said,) = state_blocked([log], aside)
    assert "hold elbow for" in str(said)
    assert found.errors[1] < 0.01  # .055 with these rows
    free = record(arm, servos.NONE)
    assert not find_blocked(CommandedRobot(arm, STICKY), free).any()
    rows = np.zeros(free.q.shape, bool)
    rows[100] = True  # lost, and equal by chance
    alike = replace(free, q_ref=np.where(rows, free.q, free.q_ref), unmeasured=rows)
    assert not are_aside(alike).any()
