"""What becomes of functions that unseen motion refutes, or that say no more than names."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from identifiability.workflows.diagnose import search
from identifiability.workflows.diagnose.gates import Naming

MATERIAL = SimpleNamespace(setting=SimpleNamespace(structure=SimpleNamespace(present=())))


@dataclass
class Found:
    """What is left of a naming, and what of it was refuted."""

    effects: tuple
    refuted: tuple


@pytest.fixture
def verify(monkeypatch, candidate):
    """Say what is left of functions in two joints, each in the stead of a name, and is refuted."""
    functions = tuple(candidate("f", p, k, unnamed=True) for k, p in enumerate("jk"))
    names = tuple(candidate("a", p, 2 + k) for k, p in enumerate("jk"))
    before = Naming(functions, dict.fromkeys("ab", 0.01), (), replaced=names)

    def ask(refutes, prefers=(), stressed=()):
        asked = []

        def list_preferred(m, left):
            there = {c.group for c in left.chosen}
            return {n.place: [n] for n in names if n.place in prefers and ("f", n.place) in there}

        def conclude(m, naming, rng):
            asked.append([c.group for c in naming.chosen])
            effects = [
                SimpleNamespace(name=c.family.name, joints=(c.place,)) for c in naming.chosen
            ]
            gone = [(e.name, e.joints[0]) in refutes for e in effects]
            return Found(
                tuple(e for e, out in zip(effects, gone, strict=True) if not out),
                tuple((e.name, *e.joints) for e, out in zip(effects, gone, strict=True) if out),
            )

        def stress(m, naming, *_):
            kept = tuple(c for c in naming.chosen if c.group not in stressed)
            return Naming(kept, naming.p_values, ())

        monkeypatch.setattr(search, "stress_named", stress)
        monkeypatch.setattr(search, "conclude", conclude)
        monkeypatch.setattr(search, "list_preferred", list_preferred)
        own = search.Search((), (), None, None, 19, (None,) * 6, lambda *_: None)
        found = own._verify(MATERIAL, before)
        return {(e.name, *e.joints) for e in found.effects}, list(found.refuted), len(asked)

    return ask


def test_what_stands_is_verified_once(verify):
    assert verify(set()) == ({("f", "j"), ("f", "k")}, [], 1)


def test_a_name_comes_back_for_the_function_that_is_refuted_which_stays_listed(verify):
    assert verify({("f", "j")}) == ({("a", "j"), ("f", "k")}, [("f", "j")], 2)
    assert verify({("f", "j"), ("f", "k")})[0] == {("a", "j"), ("a", "k")}


def test_a_name_that_comes_back_is_verified_as_well(verify):
    left, refuted, _ = verify({("f", "j"), ("a", "j")})
    assert left == {("f", "k")}
    assert refuted == [("f", "j"), ("a", "j")]


def test_a_name_comes_back_for_a_function_that_motion_made_anew_takes_away(verify):
    assert verify(set(), stressed={("f", "k")})[:2] == ({("f", "j"), ("a", "k")}, [])


def test_a_function_gives_way_to_a_name_that_foretells_as_much(verify):
    assert verify(set(), prefers="k")[:2] == ({("f", "j"), ("a", "k")}, [])


def test_a_function_stays_where_the_name_that_foretells_as_much_is_refuted(verify):
    assert verify({("a", "k")}, prefers="k")[:2] == ({("f", "j"), ("f", "k")}, [])


def test_what_is_refuted_gives_way_also_where_such_a_name_is_refuted(verify):
    left, refuted, _ = verify({("f", "j"), ("a", "k")}, prefers="k")
    assert left == {("a", "j"), ("f", "k")}
    assert refuted == [("f", "j")]
