"""A function of the position has the name of a curve, unless it is a constant or of the bodies."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose import name_curves
from identifiability.workflows.diagnose.gates import Naming


@pytest.mark.parametrize("size", [0.0, 6.0])
def test_a_constant_is_no_curve_however_large(world, candidate, size):
    x = np.linspace(-1.0, 1.0, world.rows)
    rising, falling, curve = (1.0 + x) / 2, (1.0 - x) / 2, x**2
    Q = np.linalg.qr(np.column_stack([rising, falling, curve]))[0]
    noise = np.random.default_rng(3).standard_normal(world.rows)
    noise -= Q @ (Q.T @ noise)
    rows = world.make(40.0 + size * x + noise, [rising, falling, curve])
    other = candidate("g", "j", 2, unnamed=True)
    function = candidate("f", "j", 0, 1, unnamed=True)
    m = SimpleNamespace(white=world.bench(rows, 5).whiten())
    assert name_curves.is_curved(m, (other, function), function) == (size > 0)


@pytest.mark.parametrize("curved", [True, False])
@pytest.mark.parametrize(("known", "shared"), [(True, False), (True, True), (False, False)])
def test_a_function_of_the_position_has_the_name_of_a_curve_where_it_may_have_it(
    monkeypatch, candidate, known, shared, curved
):
    """It may not where forces on the bodies, which other joints feel as well, say what it does.

    Nor where it is a constant.
    """
    function, other = (
        candidate(f"function_of_{of}", "j", k, unnamed=True, against=of)
        for k, of in enumerate(("position", "load"))
    )
    coarse, fine = (candidate("position_torque", "j", k, k + 1, flexible=True) for k in (2, 4))
    coarse, fine = replace(coarse, shape=2.0), replace(fine, shape=1.0)
    away = candidate("position_torque", "l", 6, 7, flexible=True)
    names = (coarse, fine, away) if known else (away,)

    def extended(found, beside):
        assert (beside is None) == (not found)  # noise beside what is named
        held = SimpleNamespace(error=lambda chosen: 0.9 if fine in chosen else 1.0)
        return SimpleNamespace(candidates=(*names, *found), held=held)

    def off_bodies(_, naming):
        kept = [c for c in naming.chosen if not shared or c.family.name != "position_torque"]
        return replace(naming, chosen=tuple(kept))

    monkeypatch.setattr(name_curves, "keep_off_bodies", off_bodies)
    monkeypatch.setattr(name_curves, "is_curved", lambda *_: curved)
    m = SimpleNamespace(candidates=names, extended=extended)
    known = known and curved and not shared
    again = Naming((function, other), {function.group: 0.01, other.group: 0.02}, ())
    whole, chosen, p_values = name_curves.name_curves(m, again, m)
    assert chosen == ((fine if known else function), other)
    assert p_values[chosen[0].group] == 0.01
    assert (function in whole.candidates) != known  # what it is called by name is no rival
    if known:  # not twice
        beside = replace(again, chosen=(coarse, function))
        assert name_curves.name_curves(m, beside, m)[1] == (coarse, function)
