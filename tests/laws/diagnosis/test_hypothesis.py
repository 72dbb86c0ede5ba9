"""Prices of hypotheses, what is allowed beside what, and where names stand among others."""

import numpy as np
import pytest

from identifiability.workflows.diagnose import Hypothesis, Rules
from identifiability.workflows.diagnose.hypothesis import OVER_SPEED, Catalogue

JOINTS = "abcd"


@pytest.fixture
def catalogue(candidate):
    """One basic family and two special ones in four joints, a refinement, and a function."""
    flags = {"basic": {"basic": True}, "special": {}, "spring": {"against": "position"},
             "fine": {"needs": "basic"}, "any": {"unnamed": True}}  # fmt: skip
    options = [candidate(name, joint, shape=float(s), kinds=("K",), **flags[name])
               for name in flags for joint in JOINTS for s in range(2)]  # fmt: skip
    return Catalogue(options, len(options), (), Rules())


def places(catalogue, family, joints):
    own = {c.place: k for k, c in enumerate(catalogue.candidates) if c.family.name == family}
    return [own[j] for j in joints]


def test_a_family_in_all_of_its_places_costs_no_more_than_in_one(catalogue):
    price = [catalogue.price(places(catalogue, "spring", JOINTS[:k])) for k in range(1, 5)]
    assert price[3] < price[0] < min(price[1:3])
    assert catalogue.price([]) == 0.0


def test_a_family_counts_once_and_a_second_one_as_much_again(catalogue):
    one, two = (places(catalogue, name, "a") for name in ("basic", "spring"))
    assert catalogue.price([*one, *two]) == pytest.approx(sum(map(catalogue.price, (one, two))))
    # Two special effects over one variable in one joint are rarer than in two joints.
    special = places(catalogue, "special", "a")
    fine = [places(catalogue, "fine", j) for j in "ab"]
    near, far = (catalogue.price([*special, *f]) for f in fine)
    assert near == pytest.approx(far + Rules().crowd)
    # A function costs more than a name.
    assert catalogue.price(places(catalogue, "any", "a")) > catalogue.price(special)


@pytest.mark.parametrize("family", ["basic", "special", "spring", "any"])
@pytest.mark.parametrize("joints", ["", "b", "abc", JOINTS])
def test_a_candidate_costs_what_it_adds_to_the_price_also_where_all_places_are_named(
    catalogue, family, joints
):
    rest = places(catalogue, family, joints)
    further = catalogue.further(rest)
    for k in range(len(catalogue.candidates)):
        if k not in rest:
            added = catalogue.price([*rest, k]) - catalogue.price(rest)
            assert further[k] == pytest.approx(added)


def test_a_refinement_is_allowed_where_what_it_refines_is(catalogue, candidate):
    fine = places(catalogue, "fine", "ab")
    rest = places(catalogue, "basic", "a")
    assert not catalogue.allowed([], (), functions=False)[fine].any()
    assert catalogue.allowed(rest, (), functions=False)[fine].tolist() == [True, False]
    present = Catalogue(catalogue.candidates, catalogue.given, [("basic", "b")], Rules())
    assert present.allowed([], (), functions=False)[fine].tolist() == [False, True]
    assert catalogue.fits([*rest, fine[0]])
    assert not catalogue.fits([fine[0]])


def test_what_is_refuted_or_named_already_is_not_allowed(catalogue):
    spring = places(catalogue, "spring", "ab")
    allowed = catalogue.allowed(spring[:1], {("spring", "b")}, functions=False)
    assert not allowed[[k for k, g in enumerate(catalogue.of) if g[0] == "spring"][:4]].any()
    function = places(catalogue, "any", "a")
    assert not allowed[function].any()
    assert catalogue.allowed([], (), functions=True)[function].all()


def test_the_evidence_of_a_name_is_the_mean_over_its_shapes(catalogue):
    gains = np.full(len(catalogue.candidates), -np.inf)
    at = catalogue.members["spring", "a"]
    gains[at] = [10.0, 4.0]
    (found,) = catalogue.best_of(gains, np.ones(len(gains), bool)).values()
    mean, best, shaped = found
    assert mean == pytest.approx(np.log((np.exp(10) + np.exp(4)) / 2))
    assert best == at[0]
    assert mean + shaped == pytest.approx(10.0)  # the best shape, and what it pays for being that


def test_friction_over_speed_is_one_group(candidate):
    names = ("stribeck_friction", "rising_friction", "sigmoid_friction", "quadratic_friction")
    options = [candidate(name, "a", kinds=("K",)) for name in names]
    groups = Catalogue(options, len(options), (), Rules()).of
    assert groups == [(OVER_SPEED, "a")] * 3 + [("quadratic_friction", "a")]


def test_a_hypothesis_is_what_it_has_whatever_came_first():
    one = Hypothesis().add(3, 0.5).add(5, 1.5)
    other = Hypothesis().add(5, 1.5).add(3, 0.5)
    assert one.key == other.key
    assert one.without({3}) == Hypothesis((5,), (1.5,))
    assert one.without({3, 5}) == Hypothesis()


def test_the_bound_leaves_out_no_swap_that_is_worth_it(arm):
    hidden = {"stribeck_friction@shoulder:0.2": 0.3, "joint_stiffness@elbow": 0.2}
    search = arm.search(arm.samples(hidden))
    view = search.problem.settled(())
    ranked = sorted(search.options((), view, functions=True).values(), reverse=True)
    by_place = {search.problem.candidates[k].place: k for _, k, _ in reversed(ranked)}
    h = Hypothesis(tuple(by_place.values())[:2], (0.0, 0.0))
    # Unbounded, and where only what is better than each of the best may be yielded.
    every = search._scores(
        {n.key: n for n in search._swaps(h, view, -np.inf, functions=True)}, view
    )
    best = sorted(every.values(), reverse=True)
    for worth in (best[0] - 1e-6, best[1] - 1e-6, best[-1]):
        found = {n.key for n in search._swaps(h, view, worth, functions=True)}
        assert {key for key, score in every.items() if score > worth} <= found
    assert not list(search._swaps(h, view, best[0] + 1e3, functions=True))
