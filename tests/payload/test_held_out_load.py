"""A held-out log with another load is named; the same load or a hidden effect is not."""

import numpy as np
import pytest

from identifiability import analyze, diagnose, prune
from identifiability.foundation.findings import of_key

from .planted_load import PlantedLoad

LOAD = PlantedLoad(1.5, np.array([0.4, 0.0, 0.0]), 0.01 * np.eye(3))


def look(logs, validate, verb=analyze):
    """Return the result of a verb on logs, and its findings on loads."""
    found = verb("two-link", logs, validate, quick=True)
    return found, of_key(found.hints, "held_out_load")


def stribeck(moves):
    """Return friction that makes the error on the other motion 1.45 times that on the fitted."""
    speed = moves("two-link").move.dq
    return 3.0 * np.sign(speed) * np.exp(-np.abs(speed) / 0.3)


@pytest.mark.parametrize("verb", [analyze, prune, diagnose])
def test_a_load_of_a_held_out_log_is_named_with_its_mass(make_logs, verb):
    heavier = make_logs("two-link", LOAD, seed=9)[1]
    found, (load,) = look(make_logs("two-link", seed=1), heavier, verb)
    assert load.decides
    assert abs(load.numbers["mass"] - 1.5) < 4 * load.numbers["sd"] < 0.3
    assert f"{heavier.name}, which was held out, seems to carry 1." in load
    assert load.numbers["more"] == "more"
    assert load in found.warnings
    if verb is not diagnose:
        (trust,) = (a for a in found.answers() if a.question == "May I trust it?")
        assert "read the warning" in trust.short


def test_the_lighter_log_is_named_and_a_part_that_was_set_aside_is_not_compared(make_logs):
    light = make_logs("two-link", seed=9)
    heavy = make_logs("two-link", LOAD, seed=1)
    _, (load,) = look(heavy, light[1])
    assert load.numbers["more"] == "less"
    assert look([light[0], heavy[1]], ())[1] == []


@pytest.mark.parametrize("verb", [analyze, prune, diagnose])
@pytest.mark.parametrize("hidden", [False, True])
def test_the_same_load_and_a_hidden_effect_are_no_other_load(make_logs, moves, hidden, verb):
    extra = stribeck(moves) if hidden else None
    first, other = make_logs("two-link", seed=1, extra=extra)
    _, loads = look(first, other, verb)
    assert loads == []
