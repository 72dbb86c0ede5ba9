"""Naming from numbers alone: what is tried, what it costs, what may have a name."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy import stats

from identifiability.workflows.diagnose.gates import Naming, Step, Survival, keep_surviving
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.naming import name_effects
from identifiability.workflows.diagnose.options import (
    best_by_group,
    list_options,
    price,
    signature,
)
from identifiability.workflows.diagnose.unnamed import several_curves


def run(world, torque, columns, candidates, draws=199, present=(), **rules):
    rows = world.make(torque, columns)
    return name_effects(
        world.bench(rows, draws), candidates, world.held(rows), Rules(**rules), present
    )


def named(naming):
    return [c.group for c in naming.chosen]


def quiet(world, *levels):
    """Torque Σ levels[k] e_k with noise at right angles to the first columns."""
    e = world.basis
    rest = np.random.default_rng(1).standard_normal(world.rows)
    rest -= e @ (e.T @ rest)
    return e[:, : len(levels)] @ np.array(levels, float) + rest


def test_what_stands_far_out_is_named_with_the_least_p_value_that_there_is(world, candidate):
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    for draws in (19, 99, 199):
        found = run(world, quiet(world, 30.0), [e[:, 0], e[:, 1]], options, draws)
        assert named(found) == [("a", "j")]
        assert found.p_values["a", "j"] == 1 / (draws + 1)  # never 0: the data are one draw more
        assert found.steps[0].accepted
        assert found.steps[0].reason == "named"


def test_eighteen_simulations_cannot_say_five_per_cent(world, candidate):
    e = world.basis
    found = run(world, quiet(world, 1e3), [e[:, 0]], [candidate("a", "j", 0)], 18)
    assert found.chosen == ()
    assert found.steps[0].p_value == 1 / 19
    assert found.steps[0].reason == "no candidate stands out from the noise"


@pytest.mark.parametrize("level", [0.0, 1.5, 2.2, 2.8, 3.3, 8.0])
def test_p_values_count_noise_that_reaches_as_high_anywhere(world, candidate, level):
    """The largest of all options and shapes, in the data and in every simulated noise."""
    e, k, draws = world.basis, 6, 99
    torque = quiet(world, level)
    rows = world.make(torque, [e[:, i] for i in range(k)])
    bench = world.bench(rows, draws)
    naming = name_effects(
        bench, [candidate(f"f{i}", "j", i) for i in range(k)], world.held(rows), Rules()
    )
    misfit = np.maximum(np.mean(world.held(rows).fitted_residual([]) ** 2) - 2.0, 0.0)
    sd = np.sqrt(1 + misfit)
    noise = e[:, :k].T @ bench.simulated[:, 0] / sd
    unit = np.sqrt(np.mean(noise[:, :draws] ** 2, axis=1, keepdims=True))

    def score(z):
        return -np.log(2 * stats.norm.sf(np.abs(z)))

    null = score(noise[:, draws:] / unit).max(0)
    top = score(e[:, :k].T @ torque / sd / unit[:, 0]).max()
    p = (1 + np.sum(null >= top)) / (1 + draws)
    step = naming.steps[0]
    assert step.p_value == pytest.approx(p)
    assert step.critical == pytest.approx(np.quantile(null, 0.95))
    assert step.evidence["f0", "j"] == pytest.approx(score(e[:, 0] @ torque / sd / unit[0, 0]))
    assert (named(naming) == [("f0", "j")]) == (p <= 0.05)


def test_a_second_name_takes_what_decides_between_two_models(world, candidate):
    """It is tested at exp(−DECISIVE), about two per cent; the first one at the level of the rules.

    A level of 2.15 standard errors has p = .03 of a single candidate, within .02 of 999 draws.
    """
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    columns = [e[:, 0], e[:, 1]]
    assert np.exp(-DECISIVE) < 0.03 < Rules().level
    alone = run(world, quiet(world, 0.0, 2.15), columns, options[1:], 999)
    assert alone.steps[0].p_value == pytest.approx(0.03, abs=0.015)
    assert named(alone) == [("b", "j")]
    beside = run(world, quiet(world, 30.0, 2.15), columns, options, 999)
    assert named(beside) == [("a", "j")]
    assert beside.steps[1].best == ("b", "j")
    assert beside.steps[1].reason == "no candidate stands out from the noise"
    assert np.exp(-DECISIVE) < beside.steps[1].p_value < Rules().level
    assert named(run(world, quiet(world, 30.0, 4.0), columns, options, 999)) == [
        ("a", "j"), ("b", "j"),
    ]  # fmt: skip
    # So few draws can say no more: what none of them reaches is named.
    assert len(named(run(world, quiet(world, 30.0, 20.0), columns, options, 19))) == 2


def test_more_candidates_ask_for_more(world, candidate):
    e, torque = world.basis, quiet(world)
    limits = [
        run(
            world, torque, [e[:, i] for i in range(10)],
            [candidate(f"f{i}", "j", i) for i in range(k)],
        ).steps[0].critical
        for k in (1, 3, 10)
    ]  # fmt: skip
    assert limits == sorted(limits)
    # A candidate by itself: −log of the level that it is tested at, to what 199 draws know.
    assert limits[0] == pytest.approx(-np.log(0.05), abs=0.6)
    assert limits[2] == pytest.approx(-np.log(0.05 / 10), abs=1.0)


def test_a_level_with_a_forbidden_sign_is_never_named(world, candidate):
    e = world.basis
    columns, torque = [e[:, 0], e[:, 1]], quiet(world, -30.0, 20.0)
    both = [candidate("a", "j", 0, positive=True), candidate("b", "j", 1, positive=True)]
    assert named(run(world, torque, columns, both)) == [("b", "j")]
    free = [candidate("a", "j", 0), candidate("b", "j", 1, positive=True)]
    assert named(run(world, torque, columns, free)) == [("a", "j"), ("b", "j")]
    alone = run(world, quiet(world, -30.0), columns, both[:1])
    assert alone.chosen == ()
    assert alone.steps[0].evidence["a", "j"] == 0.0


def first_named(world, candidate, a, b, first=(), second=()):
    """Which of two real effects, a and b standard errors strong, is named first."""
    e = world.basis
    options = [candidate("a", "j", 0, **dict(first)), candidate("b", "j", 1, **dict(second))]
    return run(world, quiet(world, a, b), [e[:, 0], e[:, 1]], options, most=1).steps[0].best[0]


def fits(*levels):
    return [-np.log(2 * stats.norm.sf(x)) for x in levels]


def test_an_effect_that_only_some_joints_have_costs_half_as_much_again(world, candidate):
    basic = {"basic": True}
    low, high = fits(5.0, 6.0)
    assert 1.2 < high / low < 1.5
    assert first_named(world, candidate, 5.0, 6.0, basic) == "a"
    assert first_named(world, candidate, 5.0, 6.0, basic, basic) == "b"
    assert first_named(world, candidate, 5.0, 6.0) == "b"
    low, high = fits(5.0, 6.6)
    assert 1.5 < high / low < 1.9
    assert first_named(world, candidate, 5.0, 6.6, basic) == "b"


def test_two_columns_at_a_place_cost_twice_as_much_as_one(world, candidate):
    e = world.basis
    for both, expected in ((7.0, "a"), (9.0, "b")):
        level = both / np.sqrt(2)
        options = [candidate("a", "j", 0), candidate("b", "j", 1, 2)]
        torque = quiet(world, 6.0, level, level)
        one, two = fits(6.0)[0], -stats.chi2.logsf(both**2, 2)
        assert (two > 2 * one) == (expected == "b")
        assert two > one
        found = run(world, torque, list(e[:, :3].T), options, most=1)
        assert found.steps[0].best[0] == expected


def test_a_family_in_all_its_places_costs_as_much_as_in_one(candidate):
    places = [candidate("a", p, k, kinds=("K",)) for k, p in enumerate(("j", "l", "m"))]
    other = [candidate("b", "j", 3, 4, basic=True)]
    options = list_options([*places, *other])
    assert [o.group for o in options] == [
        ("a", "j"), ("a", "l"), ("a", "m"), ("b", "j"), ("a", "all joints"),
    ]  # fmt: skip
    assert options[-1].columns == (0, 1, 2)
    assert options[-1].members == tuple(places)
    assert [price(o) for o in options] == [1.5, 1.5, 1.5, 2.0, 1.5]


def test_all_places_of_a_family_have_one_shape_together(candidate):
    grid = [
        candidate("a", place, 2 * k + s, shape=float(s), kinds=("K",))
        for k, place in enumerate(("j", "l"))
        for s in range(2)
    ]
    together = [o for o in list_options(grid) if len(o.members) > 1]
    assert [o.columns for o in together] == [(0, 2), (1, 3)]
    assert [{c.shape for c in o.members} for o in together] == [{0.0}, {1.0}]


def test_an_effect_in_every_joint_is_named_in_one_step_with_all_its_places(world, candidate):
    e = world.basis
    options = [candidate("a", place, k, kinds=("K",)) for k, place in enumerate(("j", "l", "m"))]
    found = run(world, quiet(world, 12.0, 11.0, 10.0), list(e[:, :3].T), options)
    assert found.steps[0].best == ("a", "all joints")
    assert named(found) == [("a", "j"), ("a", "l"), ("a", "m")]
    assert found.steps[0].accepted
    # Where all of them explain hardly more than one, it is at this one.
    few = [6.0, 3.0, 1.5]
    gain = stats.chi2.logsf(few[0] ** 2, 1) - stats.chi2.logsf(np.square(few).sum(), 3)
    assert 1.0 < gain < DECISIVE
    found = run(world, quiet(world, *few), list(e[:, :3].T), options)
    assert found.steps[0].best == ("a", "j")
    # A place where nothing of it stands out does not get it.
    found = run(world, quiet(world, 12.0, 11.0, 0.2), list(e[:, :3].T), options)
    assert named(found) == [("a", "j"), ("a", "l")]


def test_a_refinement_is_only_tried_where_what_it_refines_is(world, candidate):
    e = world.basis
    base = candidate("coulomb", "j", 0, kinds=("Fc",))
    fine = candidate("stribeck", "j", 1, kinds=("Fs",), needs="coulomb")
    far = candidate("stribeck", "l", 2, kinds=("Fs",), needs="coulomb")
    torque, columns = quiet(world, 12.0, 20.0, 20.0), list(e[:, :3].T)
    assert named(run(world, torque, columns, [fine, far])) == []
    found = run(world, torque, columns, [base, fine, far])
    assert named(found) == [("coulomb", "j"), ("stribeck", "j")]
    everywhere = run(world, torque, columns, [fine, far], present={("coulomb", p) for p in "jl"})
    assert sorted(named(everywhere)) == [("stribeck", "j"), ("stribeck", "l")]


def test_shapes_are_chosen_anew_beside_what_was_added(world, candidate):
    """The second shape patches up for the other effect, until that is there itself."""
    e = world.basis
    columns = [e[:, 0], world.unit(1.0, 1.0, 0.0, 0.5), e[:, 1]]
    options = [
        candidate("a", "j", 0, shape=1.0, kinds=("K",)),
        candidate("a", "j", 1, shape=2.0, kinds=("K",)),
        candidate("b", "j", 2, kinds=("K",)),
    ]
    found = run(world, quiet(world, 100.0, 60.0), columns, options)
    assert found.steps[0].best == ("a", "j")
    once = run(world, quiet(world, 100.0, 60.0), columns, options, most=1)
    assert [c.shape for c in once.chosen] == [2.0]
    assert {c.group: c.shape for c in found.chosen}["a", "j"] == 1.0
    assert sorted(named(found)) == [("a", "j"), ("b", "j")]


def test_what_the_others_explain_better_is_dropped_again(world, candidate):
    """Backward elimination: a mixture of two effects goes when both are there."""
    e = world.basis
    columns = [world.unit(1.0, 1.0), e[:, 0], e[:, 1]]
    options = [
        candidate("mixture", "j", 0), candidate("a", "j", 1), candidate("b", "j", 2),
    ]  # fmt: skip
    torque = quiet(world, 40.0, 60.0)
    found = run(world, torque, columns, options)
    assert found.steps[0].best == ("mixture", "j")
    assert len(found.chosen) == 2  # two of the three span both


def test_the_search_ends_where_all_that_is_left_lies_inside_the_model(world, candidate):
    """Nothing is compared with noise that has no room either: every limit stays a number."""
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    found = run(world, quiet(world, 40.0), [e[:, 0], -2.0 * e[:, 0]], options)
    assert named(found) == [("a", "j")]
    assert len(found.steps) == 1
    assert np.isfinite([s.critical for s in found.steps]).all()


def test_no_more_steps_than_allowed_are_made(world, candidate):
    e = world.basis
    options = [candidate(f"f{k}", "j", k) for k in range(4)]
    torque = quiet(world, 40.0, 30.0, 20.0, 10.0)
    for most in (1, 2, 3):
        found = run(world, torque, list(e[:, :4].T), options, most=most)
        assert len(found.steps) == most
        assert [g for g, _ in named(found)] == [f"f{k}" for k in range(most)]


def test_what_does_not_predict_motion_that_did_not_choose_it_has_no_name(world, candidate):
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    rows = world.make(quiet(world, 30.0, 20.0), [e[:, 0], e[:, 1]])
    other = world.make(quiet(world, 30.0, -5.0), [e[:, 0], e[:, 1]])
    held = replace(world.held(rows), choosing=other)
    found = name_effects(world.bench(rows, 199), options, held, Rules())
    assert named(found) == [("a", "j")]
    assert [s.accepted for s in found.steps[:2]] == [True, False]
    assert found.steps[1].best == ("b", "j")
    assert found.steps[1].reason == "it does not predict unseen motion better"
    assert found.steps[1].gain < 0 < found.steps[0].gain


@pytest.mark.parametrize(("gain", "expected"), [(0.002, 2), (0.4, 1), (0.999, 0)])
def test_a_name_must_gain_what_the_rules_ask_for(world, candidate, gain, expected):
    """The first effect takes a half of the error, the second one a quarter of what is left."""
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    found = run(world, quiet(world, 60.0, 15.0), [e[:, 0], e[:, 1]], options, gain=gain)
    assert 0.4 < found.steps[0].gain < 0.9
    assert 0.01 < found.steps[1].gain < 0.3
    assert named(found) == [("a", "j"), ("b", "j")][:expected]


def test_what_errs_least_as_a_real_robot_is_kept_and_not_what_came_after(world, candidate):
    @dataclass(frozen=True)
    class Strict(HeldOut):
        """As a real robot every effect but the first one does harm."""

        def error(self, chosen, *, real=False):
            return super().error(chosen) if not real else abs(len(chosen) - 1.0)

    e = world.basis
    options = [candidate(f, "j", k) for k, f in enumerate("abc")]
    rows = world.make(quiet(world, 60.0, 40.0, 30.0), list(e[:, :3].T))
    held = Strict(train=rows, choosing=replace(rows))
    found = name_effects(world.bench(rows, 99), options, held, Rules())
    assert named(found) == [("a", "j")]
    assert len(found.steps) == 3
    assert found.steps[1].gain > 0.05


def test_a_family_that_helps_nowhere_is_taken_back_and_the_search_goes_on(world, candidate):
    """Added everywhere it would do harm; what comes after it is named beside nothing of it."""

    class Harm(HeldOut):
        def errors(self, chosen, *, real=False, **more):
            found = super().errors(chosen)
            return found + 5.0 * sum(c.family.name == "a" for c in chosen)

        def error(self, chosen, *, real=False, **more):
            return float(np.mean(self.errors(chosen)))

    e = world.basis
    options = [candidate("a", "j", 0), candidate("a", "l", 1), candidate("b", "j", 2)]
    rows = world.make(quiet(world, 60.0, 55.0, 30.0), list(e[:, :3].T))
    held = Harm(train=rows, choosing=replace(rows))
    found = name_effects(world.bench(rows, 99), options, held, Rules())
    assert found.steps[0].best == ("a", "all joints")
    assert found.steps[0].gain == 0.0
    assert found.steps[0].reason == "it does not predict unseen motion better"
    assert named(found) == [("b", "j")]


def test_a_search_may_start_from_what_is_named_and_drop_what_it_makes_needless(world, candidate):
    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    torque, columns = quiet(world, 60.0), [e[:, 0], world.unit(0.9, 0.436)]
    rows = world.make(torque, columns)
    bench, held = world.bench(rows, 99), world.held(rows)
    found = name_effects(bench, options, held, Rules(), start=[options[1]])
    assert named(found) == [("a", "j")]


def test_a_gain_that_a_real_robot_does_not_have_takes_a_special_name_away(world, candidate):
    class Possible(HeldOut):
        """As a real robot no effect changes any error; the search goes by plain fits."""

        def error(self, chosen, *, real=False):
            return float(np.mean(super().errors(chosen)))

        def errors(self, chosen, *, real=False, beside=None):
            found = super().errors(chosen)
            return np.ones_like(found) if real else found

    e = world.basis
    options = [candidate("a", "j", 0), candidate("b", "j", 1, basic=True)]
    rows = world.make(quiet(world, 60.0, 40.0), [e[:, 0], e[:, 1]])
    held = Possible(train=rows, choosing=replace(rows), real=object())
    found = name_effects(world.bench(rows, 99), options, held, Rules())
    assert named(found) == [("b", "j")]
    reasons = {s.best[0]: s.reason for s in found.steps if s.p_value <= 0.05}
    assert reasons["a"] == "its gain vanishes once bodies must be possible"
    assert reasons["b"] == "named"


def test_a_search_that_no_longer_errs_less_ends_after_its_patience(world, candidate):
    @dataclass(frozen=True)
    class Flat(HeldOut):
        def error(self, chosen, *, real=False):
            return 1.0 if real else super().error(chosen)

    e = world.basis
    options = [candidate(f"f{k}", "j", k) for k in range(6)]
    rows = world.make(quiet(world, 90, 80, 70, 60, 50, 40), list(e[:, :6].T))
    held = Flat(train=rows, choosing=replace(rows))
    for patience in (1, 3):
        found = name_effects(world.bench(rows, 99), options, held, Rules(patience=patience))
        assert len(found.steps) == patience
        assert found.chosen == ()


def test_the_gain_of_a_step_is_the_relative_fall_of_the_held_out_error(world, candidate):
    e = world.basis
    rows = world.make(quiet(world, 30.0), [e[:, 0]])
    held, option = world.held(rows), candidate("a", "j", 0)
    found = name_effects(world.bench(rows, 99), [option], held, Rules())
    before, after = held.error(()), held.error([option])
    assert found.steps[0].gain == pytest.approx((before - after) / before)


def test_evidence_is_the_best_over_shapes(candidate):
    options = [
        candidate("a", "j", 0, shape=1.0), candidate("a", "j", 1, shape=2.0),
        candidate("b", "j", 2),
    ]  # fmt: skip
    found = best_by_group(options, np.array([1.0, 3.0, -np.inf]))
    assert found == {("a", "j"): 3.0, ("b", "j"): 0.0}
    assert signature(options[:1]) == signature(options[1:2])


def test_a_name_that_is_refuted_takes_its_refinements_with_it(candidate):
    base = candidate("coulomb", "j", 0, kinds=("Fc",))
    there = candidate("coulomb", "l", 1, kinds=("Fc",))
    fine = [candidate("stribeck", p, k, kinds=("Fs",), needs="coulomb")
            for k, p in enumerate(("j", "l"), 2)]  # fmt: skip
    steps = tuple(
        Step(evidence={}, critical=1.0, best=best, p_value=0.01, gain=0.1, accepted=True,
             reason="named")
        for best in (("coulomb", "all joints"), ("stribeck", "j"))
    )  # fmt: skip
    stress = {base.slot: (Survival(variation="any", score=1.0, same_sign=True),)}
    naming = Naming(chosen=(base, there, *fine), p_values={}, steps=steps, stress=stress)
    left = keep_surviving(naming, [base], (), "the reason")
    assert named(left) == [("coulomb", "l"), ("stribeck", "l")]
    assert left.stress == stress
    assert [s.accepted for s in left.steps] == [True, True]  # both families still have a place
    gone = keep_surviving(naming, [base, there], (), "the reason")
    assert gone.chosen == ()
    assert [s.accepted for s in gone.steps] == [False, False]
    assert [s.reason for s in gone.steps] == ["the reason"] * 2
    # Where the base model has it, refinements do not need the named one.
    assert (
        len(keep_surviving(naming, [base, there], {("coulomb", p) for p in "jl"}, "").chosen) == 2
    )


def test_friction_by_one_speed_under_several_names_is_several_curves(candidate):
    def curve(name, place, k, **flags):
        return candidate(name, place, k, **{"needs": "viscous", **flags})

    bump, smooth = curve("bump", "j", 0), curve("smooth", "j", 1)
    alone = curve("bump", "l", 2)
    others = [
        curve("play", "l", 3, late=True), curve("leak", "l", 4, origin=lambda e, r: 0),
        curve("drift", "l", 5, against="time"), candidate("viscous", "l", 6, basic=True),
    ]  # fmt: skip
    assert several_curves([bump, alone, smooth, *others]) == [bump, smooth]
    assert several_curves([alone, *others]) == []


def test_torque_by_one_position_under_several_names_is_several_curves(candidate):
    """An offset beside a spring is one of them; alone, or where something rubs, it is not."""
    spring = candidate("joint_stiffness", "j", 0, against="position")
    offset, other = (candidate("torque_offset", p, k, basic=True) for p, k in (("j", 1), ("l", 2)))
    rubs = candidate("rough", "l", 3, against="position", dry=True)
    bump = candidate("bump", "j", 4, needs="viscous")
    assert several_curves([offset, other, spring, rubs, bump]) == [offset, spring]
    assert several_curves([offset, other, rubs, bump]) == []
