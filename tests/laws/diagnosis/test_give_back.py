"""A function without a name gives way to names: to those it replaced, or that foretell as much."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose.gates import Naming, Step, keep_surviving
from identifiability.workflows.diagnose.give_back import give_back, list_preferred, with_denied

PRESENT = ()


def groups(chosen):
    return [c.group for c in chosen]


@pytest.fixture
def replaced(candidate):
    """Two names, and a third that only refines one; functions in two joints replaced them all."""
    names = [candidate("a", "j", 0), candidate("b", "k", 1), candidate("r", "j", 2, needs="a")]
    functions = [candidate("f", place, 3 + at, unnamed=True) for at, place in enumerate("jk")]
    p_values = {c.group: 0.01 for c in functions} | {c.group: 0.02 for c in names}
    return Naming(tuple(functions), p_values, (), replaced=tuple(names))


def test_a_refuted_function_gives_back_the_names_of_its_joint_at_twice_their_price(replaced):
    back = give_back(replaced, {("f", "j")}, PRESENT)
    assert groups(back.chosen) == [("f", "k"), ("a", "j"), ("r", "j")]
    assert back.p_values["a", "j"] == pytest.approx(0.04)
    assert back.p_values["f", "k"] == 0.01
    # What stays replaced can come back when the other function is refuted, too.
    again = give_back(back, {("f", "k")}, PRESENT)
    assert groups(again.chosen) == [("a", "j"), ("r", "j"), ("b", "k")]
    assert again.p_values["a", "j"] == pytest.approx(0.04)


def test_where_no_function_is_left_all_that_they_replaced_comes_back(replaced, candidate):
    elsewhere = replace(replaced, replaced=(candidate("c", "m", 9),))
    both = {("f", "j"), ("f", "k")}
    assert groups(give_back(elsewhere, both, PRESENT).chosen) == [("c", "m")]
    assert give_back(elsewhere, {("f", "j")}, PRESENT) is None


def test_nothing_comes_back_where_nothing_is_refuted_or_was_replaced(replaced, candidate):
    assert give_back(replaced, (), PRESENT) is None
    both = {("f", "j"), ("f", "k")}
    assert give_back(replace(replaced, replaced=()), both, PRESENT) is None
    named = replace(replaced, chosen=(candidate("d", "j", 7),))
    assert give_back(named, {("d", "j")}, PRESENT) is None


def test_what_refines_a_name_does_not_come_back_without_it(replaced):
    refines = replace(replaced, replaced=replaced.replaced[2:])
    both = {("f", "j"), ("f", "k")}
    assert groups(give_back(refines, both, PRESENT).chosen) == []
    assert groups(give_back(refines, both, {("a", "j")}).chosen) == [("r", "j")]


def test_a_function_gives_way_to_what_is_preferred_and_not_to_what_it_replaced(replaced, candidate):
    denied = candidate("d", "j", 8)
    for gone in (set(), {("f", "j")}):
        back = give_back(replaced, gone, PRESENT, {"j": [denied]})
        assert groups(back.chosen) == [("f", "k"), ("d", "j")]


def test_the_steps_say_what_came_back_and_for_what(replaced):
    """Of those that named it: one that had been refused before stays refused."""
    accepted = [Step({}, 1.0, best, 0.01, accepted=True) for best in [("a", "j"), ("b", "k")]]
    refused = Step({}, 1.0, ("a", "j"), 0.01, reason="no gain")
    functions = [Step({}, 1.0, c.group, 0.01, accepted=True) for c in replaced.chosen]
    names = Naming(replaced.replaced, {}, (refused, *accepted))
    left = keep_surviving(names, names.chosen, PRESENT, "a function explains it better")
    naming = replace(replaced, steps=(*left.steps, *functions))
    steps = give_back(naming, {("f", "j"), ("f", "k")}, PRESENT).steps
    assert [s.accepted for s in steps] == [False, True, True, False, False]
    assert steps[0].reason == "no gain"
    assert "in the stead of a function" in steps[1].reason
    assert "comes back" in steps[3].reason


class Unseen:
    """Unseen motion that says so much for candidates at a place, whatever stands beside them."""

    def __init__(self, candidates, told):
        self.candidates, self.told = candidates, told
        self.train = SimpleNamespace(X=np.empty((9, 2, 4)))
        self.beside = []

    def unseen(self, chosen):
        def of_effect(own):
            assert min(own) >= 4  # behind the base model's columns
            columns = [c.group for c in chosen for _ in c.columns]
            asked = tuple(dict.fromkeys(columns[k - 4] for k in own))
            assert len(own) == sum(len(c.columns) for c in chosen if c.group in asked)
            self.beside.append((asked, [c.group for c in chosen if c.group not in asked]))
            return SimpleNamespace(evidence=self.told[asked])

        return SimpleNamespace(of_effect=of_effect)


@pytest.fixture
def contest(candidate):
    """A function in `j` beside a name in `k`: it replaced one name, and another was denied."""
    function, beside = candidate("f", "j", 0, 1, 2, unnamed=True), candidate("b", "k", 3)
    name, denied = candidate("a", "j", 4), candidate("d", "j", 5, 6)
    naming = Naming((beside, function), {}, (), replaced=(name,), denied=(denied,))

    def ask(function=20.0, name=0.0, denied=0.0):
        told = {(("f", "j"),): function, (("a", "j"),): name, (("d", "j"),): denied}
        m = Unseen((*naming.chosen, *naming.replaced, *naming.denied), told)
        found = list_preferred(m, naming)
        assert all(rest == [("b", "k")] for _, rest in m.beside)
        return {place: groups(own) for place, own in found.items()}

    return ask


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({"name": 20.0}, {"j": [("a", "j")]}),
        ({"name": 19.9}, {}),
        ({"denied": 20.0}, {"j": [("d", "j")]}),
        ({"name": 21.0, "denied": 22.0}, {"j": [("d", "j")]}),
        ({"name": 23.0, "denied": 22.0}, {"j": [("a", "j")]}),
        # Unseen motion that says little for any of them does not speak against the fitted one.
        ({"function": 1.0, "name": 3.9}, {}),
        ({"function": 1.0, "name": 4.1}, {"j": [("a", "j")]}),
    ],
)
def test_a_name_is_preferred_where_it_foretells_unseen_motion_as_well(contest, told, expected):
    assert contest(**told) == expected


def test_names_that_were_replaced_at_a_place_foretell_together(candidate):
    function, one, two = (
        candidate("f", "j", 0, 1, unnamed=True),
        candidate("a", "j", 2),
        candidate("b", "j", 3),
    )
    naming = Naming((function,), {}, (), replaced=(one, two, candidate("c", "k", 4)))
    both = ("a", "j"), ("b", "j")
    # Two causes in the stead of one: the second takes what decides between two names.
    told = {(("f", "j"),): 20.0, both: 23.9}
    assert list_preferred(Unseen((), told), naming) == {}
    told[both] = 24.1
    assert list_preferred(Unseen((), told), naming) == {"j": [one, two]}
    more = replace(naming, chosen=(function, candidate("g", "j", 5, unnamed=True)))
    told = {(("f", "j"), ("g", "j")): 20.0, both: 20.0}
    assert list_preferred(Unseen((), told), more) == {"j": [one, two]}


def test_only_what_was_denied_where_a_function_is_now_is_remembered_as_it_is_there(candidate):
    m = SimpleNamespace(
        candidates=[
            candidate("a", "j", 3, shape=1.0),
            candidate("a", "j", 4, shape=2.0),
            candidate("d", "j", 5),
            candidate("a", "k", 6),
        ]
    )
    denied = [
        candidate("a", "j", 0, shape=2.0),
        candidate("d", "j", 1),
        candidate("a", "k", 2),
        candidate("e", "j", 9),
    ]
    functions = Naming((candidate("f", "j", 7, unnamed=True), candidate("b", "k", 8)), {}, ())
    assert with_denied(functions, denied, m).denied == (m.candidates[1], m.candidates[2])
    # Where the cause is elsewhere a name foretells as much as a function, and is as wrong.
    assert with_denied(functions, denied, m, {"k"}).denied == (m.candidates[1], m.candidates[2])
    assert with_denied(functions, denied, m, {"j"}).denied == ()
    # An offset that is the mean of a curve is one of the function, too.
    offset = [candidate("d", "j", 1, basic=True)]
    assert with_denied(functions, offset, m).denied == ()
