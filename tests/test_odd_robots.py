"""Odd but legal robots have an answer, and intervals that hold."""

import json
from types import SimpleNamespace

import pytest
from odd_robots import Odd, outside

from identifiability import IdentifiabilityError, Robot, analyze
from identifiability.foundation.output import plain
from identifiability.workflows.analyze.words import state_physics


def ask(odd, folder):
    """Return what is said of a robot, as it stands in its JSON; its refusal, if it is refused."""
    path = folder / "robot.xml"
    path.write_text(odd.text(0.1))
    try:
        found = analyze(Robot.load(path), odd.log(0), validate=odd.log(1), replicates=100)
    except IdentifiabilityError as error:
        return path, str(error)
    return path, json.loads(json.dumps(plain(found.to_dict())))


@pytest.mark.parametrize(
    ("robots", "joints", "most"),
    [(6, 2.0, 3_000), pytest.param(40, 8.0, 30_000, marks=pytest.mark.everything)],
)
def test_odd_robots_have_an_answer_and_intervals_that_hold(robots, joints, most, tmp_path):
    called = wrong = answered = 0
    for seed in range(50_000, 50_000 + robots):
        odd = Odd.draw(seed, joints, most)
        path, told = ask(odd, tmp_path)
        if isinstance(told, str):
            assert told.endswith(".")
            continue
        answered += 1
        assert "nan" not in told["statement"].split()
        counts = outside(odd, path, told)
        called, wrong = called + counts[0], wrong + counts[1]
    assert answered > robots / 2
    assert called > robots / 2
    assert wrong <= 0.07 * called + 2 * (0.07 * called) ** 0.5


def test_an_error_that_was_not_measured_is_no_number():
    chosen = SimpleNamespace(feasible=False, error_ra_physical=float("nan"))
    chosen.physical = SimpleNamespace(nearest="some")
    assert "too short to say how much" in state_physics(chosen)


@pytest.mark.parametrize(
    ("scale", "mass", "kinds", "rate", "samples"),
    [
        (1e-3, 1e-3, "HS", 2e4, 30),
        (10.0, 1e3, "H" * 5, 10.0, 30),
        (10.0, 1e-3, "SS", 2e4, 60),
    ],
)
def test_the_corners_are_answered_or_one_sentence(scale, mass, kinds, rate, samples, tmp_path):
    odd = Odd(scale, mass, kinds, rate, samples, rate / 25, 7)
    told = ask(odd, tmp_path)[1]
    assert isinstance(told, dict) or told.count(". ") <= 2
