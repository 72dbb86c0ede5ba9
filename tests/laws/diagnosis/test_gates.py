"""Gates: by how much a name must predict better, and as what robot, from told gains."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from identifiability.workflows.diagnose.findings import NamedEffect, Placement
from identifiability.workflows.diagnose.gates import (
    Survival,
    add_places,
    keep_possible,
    keep_useful,
    keep_where,
    list_units,
)
from identifiability.workflows.diagnose.held_out import Gain
from identifiability.workflows.diagnose.lookalikes import Rival
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.shown import Shown


@dataclass
class Told:
    """Gains that are told: what each group takes away when it is missing, and its error."""

    gains: dict
    error: float = 0.0
    real: object = None
    asked: list = field(default_factory=list)

    def gain(self, rest, whole, *, real=False):
        self.asked.append(({c.group for c in rest}, {c.group for c in whole}, real))
        lost = {c.group for c in whole} - {c.group for c in rest}
        return Gain(share=sum(self.gains[g] for g in lost), error=self.error)


@pytest.fixture
def pair(candidate):
    return [candidate("a", "j", 0), candidate("b", "j", 1)]


def groups(chosen):
    return [c.group for c in chosen]


@pytest.mark.parametrize(("gain", "kept"), [(0.0019, False), (0.002, False), (0.0021, True)])
def test_a_name_must_gain_more_than_two_per_mille(pair, gain, kept):
    held = Told({("a", "j"): 0.5, ("b", "j"): gain})
    assert groups(keep_useful(held, pair, Rules())) == [("a", "j"), ("b", "j")][: 1 + kept]
    assert Rules().gain == 0.002
    assert not any(real for *_, real in held.asked)


def test_names_are_taken_out_one_at_a_time_the_least_useful_first(candidate):
    """Two that repair each other: once the worse one is gone the other one gains."""
    a, b = candidate("a", "j", 0), candidate("b", "j", 1)

    class Pair:
        def gain(self, rest, whole, *, real=False):
            there, was = ({c.group[0] for c in x} for x in (rest, whole))
            value = {(): 0.0, ("a",): 0.3, ("b",): -0.1, ("a", "b"): 0.2}
            return Gain(share=value[tuple(sorted(was))] - value[tuple(sorted(there))], error=0.0)

    assert groups(keep_useful(Pair(), [a, b], Rules())) == [("a", "j")]
    assert groups(keep_useful(Pair(), [b], Rules())) == []


def test_a_family_keeps_the_places_where_it_predicts_better_and_others_are_not_asked(candidate):
    old = [candidate("b", "j", 3)]
    new = [candidate("a", place, k) for k, place in enumerate("jlm")]
    held = Told({("a", "j"): 0.3, ("a", "l"): -0.2, ("a", "m"): 0.1})
    assert groups(keep_where(held, old, new, Rules())) == [("a", "j"), ("a", "m")]
    assert all(("b", "j") in rest and ("b", "j") in whole for rest, whole, _ in held.asked)
    assert keep_where(Told({g.group: -0.1 for g in new}), old, new, Rules()) == []


def test_a_family_is_judged_at_each_place_and_as_a_whole(candidate):
    chosen = [candidate("a", "j", 0), candidate("a", "l", 1), candidate("b", "j", 2)]
    units = [groups(u) for u in list_units(chosen)]
    assert units == [[("a", "j")], [("a", "l")], [("b", "j")], [("a", "j"), ("a", "l")]]

    class Family:  # each place is of use beside the other one, both together are not
        def gain(self, rest, whole, *, real=False):
            lost = {c.group for c in whole} - {c.group for c in rest}
            return Gain(share=-0.1 if lost == {("a", "j"), ("a", "l")} else 0.1, error=0.0)

    assert groups(keep_useful(Family(), chosen, Rules())) == [("b", "j")]


@pytest.mark.parametrize(
    ("gain", "error", "kept"),
    [(0.05, 0.01, True), (0.05, 0.06, False), (0.05, 0.05, False), (0.0019, 0.0, False),
     (-0.1, 0.0, False)],
)  # fmt: skip
def test_in_a_real_robot_a_gain_must_exceed_its_standard_error_too(pair, gain, error, kept):
    held = Told({("a", "j"): gain}, error, real=object())
    assert groups(keep_possible(held, pair[:1], pair, Rules())) == [("a", "j")] * kept
    assert all(real for *_, real in held.asked)
    # Where no robot can be fitted nothing is asked.
    assert keep_possible(Told({}), pair[:1], pair, Rules()) == pair[:1]


def test_what_every_joint_has_is_not_refused_and_stands_at_every_place_beside_the_rest(candidate):
    spring = candidate("spring", "j", 0)
    dry = candidate("dry", "j", 1, basic=True)
    elsewhere = [
        candidate("dry", "l", 2, basic=True), candidate("dry", "l", 3, basic=True),
        candidate("spring", "l", 4), candidate("offset", "l", 5, basic=True),
    ]  # fmt: skip
    every = [spring, dry, *elsewhere]
    held = Told({("spring", "j"): -1.0}, real=object())
    assert groups(keep_possible(held, [spring, dry], every, Rules())) == [("dry", "j")]
    rest, whole, _ = held.asked[0]
    assert rest == {("dry", "j"), ("dry", "l")}
    assert whole == rest | {("spring", "j")}
    assert groups(add_places([dry], every)) == [("dry", "j"), ("dry", "l")]


@pytest.mark.parametrize(
    ("interval", "confirmed", "refuted"),
    [((-0.9, -0.1), True, False), ((-0.9, 0.1), False, False), ((0.1, 0.2), False, True),
     ((-0.6, 0.0), False, False), ((0.0, 0.1), False, True)],
)  # fmt: skip
def test_the_motion_that_verifies_confirms_refutes_or_leaves_open(interval, confirmed, refuted):
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.1), shown=Shown(0.2, 0.1, interval, -0.5),
                         )  # fmt: skip
    assert (effect.confirmed, effect.refuted) == (confirmed, refuted)


@pytest.mark.parametrize(
    ("interval", "expected", "refuted"),
    [((-0.1, 0.05), -0.2, True), ((-0.1, 0.05), -0.08, False), ((-0.1, -0.01), -0.2, False),
     ((-0.1, 0.0), -0.11, True), ((-0.1, 0.0), -0.1, False)],
)  # fmt: skip
def test_an_effect_large_enough_to_show_that_does_not_show_is_refuted(interval, expected, refuted):
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.5), shown=Shown(0.2, 0.1, interval, expected),
                         )  # fmt: skip
    assert effect.refuted == refuted
    # What is rare must be confirmed where its change is known to less than itself, ends included;
    # what harms elsewhere is refuted, whatever its own joints.
    tells = interval[1] >= 0 and interval[1] - interval[0] < -expected
    assert replace(effect, rare=True).refuted == (refuted or tells)
    assert replace(effect, joints_interval=(0.1, 0.2)).refuted
    # What surely helps over all joints is confirmed, unless its own surely suffer.
    assert replace(effect, joints_interval=(-0.5, -0.1)).confirmed


def test_what_is_expected_of_an_effect_knows_the_error_of_its_size():
    """An effect of 7 errors may be 28 % smaller: what it adds then brings 44 % of the fall."""
    shown = Shown(0.2, 0.1, (-0.1, 0.05), -0.2)
    assert shown.least == -0.2
    known = replace(shown, strength=7.0)
    assert known.least == pytest.approx((1 - 2 * 1.96 / 7) * -0.2, rel=1e-3)
    assert shown.contradicts
    assert not known.contradicts
    assert replace(known, interval=(-0.08, 0.05)).contradicts
    # Of what may be half as large nothing is expected; it is contradicted by harm alone.
    small = replace(shown, strength=3.0, interval=(-0.001, 0.05))
    assert small.least == 0
    assert not small.contradicts
    assert replace(small, interval=(0.001, 0.05)).contradicts


@pytest.mark.parametrize(
    ("interval", "unnamed", "refuted"),
    [((-0.3, 0.1), False, False), ((-0.3, 0.1), True, True), ((-0.15, 0.01), False, False),
     ((-0.08, 0.01), False, True)],
)  # fmt: skip
def test_what_is_rare_must_be_confirmed_by_motion_that_can(interval, unnamed, refuted):
    """A fall of 0.1 is not sure where the change is known to 0.08; it is where to 0.045."""
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.5), shown=Shown(0.2, 0.1, interval, -0.1, 4.0),
                         rare=True, unnamed=unnamed)  # fmt: skip
    assert not effect.confirmed
    assert effect.refuted == refuted


@pytest.mark.parametrize(
    ("after", "news", "confirmed"),
    [(0.1, (0.1, 0.9), True), (0.1, (-0.1, 0.9), False), (0.21, (0.1, 0.9), False)],
)
def test_an_effect_that_is_surely_there_is_confirmed_where_the_error_does_not_rise(
    after, news, confirmed
):
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.1), unnamed=True,
                         shown=Shown(0.2, after, (-0.3, 0.1), -0.1, news=news))  # fmt: skip
    assert effect.confirmed == confirmed
    assert effect.refuted == (not confirmed)
    # Harm that is sure is not outweighed.
    assert replace(effect, joints_interval=(0.1, 0.2)).refuted


def test_a_named_effect_speaks_for_all_its_places():
    def place(where, p, *rivals, stress=()):
        return Placement(
            place=where, shape=float("nan"), p_value=p, parameters=(), units=(), values=None,
            errors=None, rms=1.0, rivals=rivals, stress=stress,
        )  # fmt: skip

    def rival(family, similarity, undecided):
        return Rival(family=family, place="j", similarity=similarity, undecided=undecided)

    fragile = place(
        "l", 0.04, rival("stribeck_friction", 0.99, True), rival("b", 0.5, False),
        stress=(Survival(variation="x", score=1.0, same_sign=True),
                Survival(variation="y", score=9.0, same_sign=True)),
    )  # fmt: skip
    effect = NamedEffect(
        name="a", title="A", placements=(place("j", 0.01, rival("b", 0.7, False),
        rival("a", 1.0, True)), fragile), before=0.2, after=0.1, interval=(-1.0, -0.5),
        joints_before=0.2, joints_after=0.1, joints_interval=(-1.0, -0.5),
        shown=Shown(0.2, 0.1, (-1.0, -0.5), -0.7),
    )  # fmt: skip
    assert effect.joints == ("j", "l")
    assert effect.p_value == 0.04
    assert effect.similar == {"stribeck_friction": 0.99, "b": 0.7}
    assert effect.alternatives == ("stribeck_friction",)
    assert effect.names == "A or Stribeck friction"
    assert fragile.fragile == ("x",)


@pytest.mark.parametrize(
    ("interval", "joints"), [((0.01, 0.3), (-0.5, 0.1)), ((-0.1, 0.1), (0.01, 0.1))]
)
@pytest.mark.parametrize(("news", "refuted"), [((0.2, 0.8), False), ((-0.1, 0.8), True)])
def test_what_is_surely_there_is_not_refuted_by_slow_noise(interval, joints, news, refuted):
    """The error may rise by chance of noise with a memory; what that does not foretell decides."""
    effect = NamedEffect("a", "a", (), before=0.2, after=0.1, interval=(-0.2, 0.1),
                         joints_before=0.2, joints_after=0.3, joints_interval=joints,
                         shown=Shown(0.2, 0.3, interval, -0.1, news=news))  # fmt: skip
    assert not effect.confirmed
    assert effect.refuted == refuted
    # What must be confirmed is, by motion that would.
    rare = replace(effect, rare=True, shown=replace(effect.shown, expected=-9.0))
    assert rare.shown.telling
    assert rare.refuted
