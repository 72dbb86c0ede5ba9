"""Where robot file, limits and physics contradict a log it is said, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze, prepare_log
from identifiability.quality import MeasuredLogs, find_oddities
from identifiability.quality.hints import measure_legs
from identifiability.quality.registry import CHECKS, Does, check
from identifiability.regression.structure import Structure

from .conftest import MODEL, record, say


def test_a_good_log_is_not_spoken_of(good):
    assert say(*good) == ()


@pytest.mark.parametrize("factor", [1000.0, 1e-3, 0.02])
def test_torque_in_another_unit(good, factor):
    structure, log = good
    (hint,) = say(structure, replace(log, tau=factor * log.tau))
    assert "the torque that the robot file predicts" in hint
    assert "by about as much at all joints" in hint
    assert ('.current [mA]"' in hint) == (factor == 1000.0)
    guess = replace(structure.robot, guessed=structure.robot.bodies)  # of which nothing follows
    assert say(Structure.of(guess, MODEL), replace(log, tau=factor * log.tau)) == ()


def test_lengths_of_legs_that_are_drawn_at_zero(tmp_path):
    """Legs of twice the length fit nearly as well, with other masses."""
    structure, log = record("3-rps")
    drawn = structure.robot.path.read_text(encoding="utf-8")
    for old, new in ((' range="0.55 0.85"', ' ref="-0.7"'), (" 0.69999999999999996", " 0")):
        drawn = drawn.replace(old, new)
    (tmp_path / "legs.xml").write_text(drawn, encoding="utf-8")
    structure = Structure.of(Robot.load(tmp_path / "legs.xml"), MODEL)
    (hint,) = say(structure, log)
    assert hint.endswith('"*" = {offset = -0.7}.')
    assert say(structure, replace(log, q=log.q - 0.7)) == ()
    inertia = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
    finger = f'<body name="finger"><joint name="jaw" type="slide"/>{inertia}</body>'
    for old, new in (
        ("<worldbody>", f"<worldbody>{finger}"),
        ('qpos="', 'qpos="0 '),
        ("</actuator>", '<motor joint="jaw"/></actuator>'),
    ):
        drawn = drawn.replace(old, new)
    (tmp_path / "legs.xml").write_text(drawn, encoding="utf-8")
    legs = measure_legs(Robot.load(tmp_path / "legs.xml"))
    assert sorted(np.isnan(legs)) == [False] * 3 + [True]


def test_a_check_of_ones_own_is_one_function(six_axis):
    """What it says goes before what it explains; of columns that are misread it withholds more."""
    structure, log = six_axis
    turned = replace(log, tau=1000.0 * log.tau)
    logs = MeasuredLogs(structure, (turned,), (prepare_log(structure.robot, turned),))
    before = find_oddities(logs)
    assert before.explains
    assert not before.misread
    sound = MeasuredLogs(structure, (log,), (prepare_log(structure.robot, log),))
    keys = [c.key for c in CHECKS]
    for does, logs_, hints in (
        (Does.EXPLAINS, sound, ("Mine.",)),
        (Does.MISREADS, sound, ("Mine.",)),
        (Does.HINTS, logs, (*before.hints, "Mine.")),
        (Does.EXPLAINS, logs, before.hints),
    ):
        check("mine", does)(lambda _: ("Mine.",))
        own = next(c for c in CHECKS if c.key == "mine")
        try:
            found = find_oddities(logs_)
        finally:
            CHECKS.remove(own)
        assert found.hints == hints
        assert found.misread == (does is Does.MISREADS)
        assert found.explains == (does is not Does.HINTS or before.explains)
    assert [c.key for c in CHECKS] == keys


def test_whole_turns_are_no_other_zero(six_axis):
    structure, log = six_axis
    turns = 2 * np.pi * np.array([0, 0, 0, 1, -3, 2])
    assert say(structure, replace(log, q=log.q + turns)) == ()


def test_positions_of_another_sign_are_read_as_they_are_meant():
    structure, log = record("two-link", samples=900)
    both = replace(log, q=log.q * [1.0, -1.0]), log
    found, sound = (analyze(structure.robot, x, replicates=10) for x in both)
    assert "elbow seem to have the wrong sign" in found.hints[0]
    assert found.chosen.error_ra_validation == pytest.approx(sound.chosen.error_ra_validation)


def test_torque_that_stops_at_its_limit_is_said(simulated):
    log = simulated("two-link", "a")
    whole = replace(log, tau=log.tau.clip(-np.inf, 0.7 * log.tau.max(0)))
    said = [x for x in analyze("two-link", whole, replicates=0).hints if "stops at an extreme" in x]
    assert len(said) == 1
    assert "'shoulder.tau' stays at" in said[0]
    assert not any("extreme" in x for x in analyze("two-link", log, replicates=0).hints)


def test_drives_that_are_off_while_the_robot_moves_are_said(good):
    structure, log = good
    on = np.arange(len(log.t)) < 0.8 * len(log.t)
    (hint,) = say(structure, replace(log, tau=log.tau * np.where(on, 1.0, 1e-3)[:, None]))
    assert "the drives were off" in hint


def test_torque_of_another_joint_is_said(good):
    structure, log = good
    (hint, *_) = say(structure, replace(log, tau=np.hstack([log.tau[:, :1], log.tau[:, :-1]])))
    assert "one was copied" in hint
