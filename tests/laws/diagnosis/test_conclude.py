"""What must be true of any conclusion: what it says stands, what it says is refuted, its model.

Names in four joints, each of which unseen motion shows, contradicts or leaves in doubt, some of
them only as long as another name is there.
"""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose import conclude as module
from identifiability.workflows.diagnose.gates import Naming

PLACES = "jk"
FAMILIES = "abc"


@dataclass(frozen=True)
class Said:
    """What a motion says of a name at some places: how much the error surely rises."""

    name: str
    joints: tuple[str, ...]
    rise: float
    doubted: bool
    placements: tuple = ()

    @property
    def refuted(self):
        return self.rise > 0

    @property
    def joints_interval(self):
        return self.rise, self.rise + 1.0


@dataclass
class Unseen:
    """Motion that verifies: the rise by each (family, place), more beside what spoils it."""

    own: dict
    spoiled: dict
    doubted: frozenset

    def rise(self, groups, chosen):
        found = [
            self.own[g] + sum(x for by, x in self.spoiled.get(g, ()) if by in chosen)
            for g in groups
        ]
        return float(np.mean(found))

    def say(self, family, places, chosen):
        groups = [(family, p) for p in places]
        return Said(family, tuple(places), self.rise(groups, chosen), family in self.doubted)

    def tell(self, naming):
        """Every family that is named, and each of its places where there are several."""
        chosen = {c.group for c in naming.chosen}
        where = {f: [p for p in PLACES if (f, p) in chosen] for f in FAMILIES}
        families = [self.say(f, ps, chosen) for f, ps in where.items() if ps]
        apart = [self.say(f, [p], chosen) for f, ps in where.items() if len(ps) > 1 for p in ps]
        return families, apart


@pytest.fixture
def conclude(monkeypatch, candidate):
    """A function: unseen motion -> what is concluded of every name in every joint."""
    groups = [(f, p) for f in FAMILIES for p in PLACES]
    every = [candidate(f, p, k) for k, (f, p) in enumerate(groups)]
    chosen = tuple(replace(c, effect=c.family.effect) for c in every)

    def ask(unseen):
        monkeypatch.setattr(
            module, "_verify", lambda m, naming, *_: SimpleNamespace(
                effects=tuple(unseen.tell(naming)[0]),
                gap=SimpleNamespace(interval=lambda *_: (0.0, 0.0)),
            )
        )  # fmt: skip
        monkeypatch.setattr(module, "_each_place", lambda m, naming, *_: unseen.tell(naming)[1])
        for name in ("find_discrepancies", "smallest_sizes"):
            monkeypatch.setattr(module, name, lambda *_: ())
        monkeypatch.setattr(module, "_write_part", lambda _, p: f"{p.effect.name}@{p.owner}")
        monkeypatch.setattr(module, "Diagnosis", SimpleNamespace)
        robot = SimpleNamespace(joints=tuple(PLACES))
        own = SimpleNamespace(robot=robot, present=frozenset(), model=SimpleNamespace(effects=()))
        material = SimpleNamespace(
            setting=SimpleNamespace(structure=own), train=SimpleNamespace(counts=np.full(2, 3)),
            white=None, candidates=(), aliases=(), refusals=(),
            remains=lambda _: SimpleNamespace(joints=()),
            held=SimpleNamespace(fitted_residual=lambda _: np.zeros((3, 2))),
        )  # fmt: skip
        naming = Naming(chosen, dict.fromkeys((c.group for c in chosen), 0.01), ())
        return module.conclude(material, naming, np.random.default_rng(0))

    return ask


def groups(effects):
    return {(e.name, j) for e in effects for j in e.joints}


def draw(seed):
    rng = np.random.default_rng(seed)
    own = {(f, p): float(rng.normal(-0.2, 1.0)) for f in FAMILIES for p in PLACES}
    every = list(own)
    spoiled = {g: [(every[rng.integers(len(every))], float(rng.exponential()))] for g in every
               if rng.random() < 0.5}  # fmt: skip
    spoiled = {g: [(by, x) for by, x in some if by != g] for g, some in spoiled.items()}
    return Unseen(own, spoiled, frozenset(f for f in FAMILIES if rng.random() < 0.3))


@pytest.mark.parametrize("seed", range(30))
def test_whatever_is_concluded_is_consistent(conclude, seed):
    unseen = draw(seed)
    found = conclude(unseen)
    stands, refuted = groups(found.effects), groups(found.refuted)
    # What stands is refuted neither as a whole nor at any of its places, beside all that stands.
    families, apart = unseen.tell(SimpleNamespace(
        chosen=[SimpleNamespace(group=g) for g in stands]))  # fmt: skip
    assert not any(e.refuted for e in (*families, *apart))
    # Nothing is both; each is refuted once, and what was in doubt is not called refuted.
    assert not stands & refuted
    assert sum(len(e.joints) for e in found.refuted) == len(refuted)
    assert not any(e.doubted for e in found.refuted)
    assert all(e.refuted for e in found.refuted)
    # What is in neither was in doubt.
    every = {(f, p) for f in FAMILIES for p in PLACES}
    assert {f for f, _ in every - stands - refuted} <= unseen.doubted
    # The model has what stands where it stands, and no more.
    assert {tuple(text.split("@")) for text in found.model.texts} == stands


@pytest.mark.parametrize("doubted", [False, True])
@pytest.mark.parametrize("worse", [0.6, 1.6])
def test_what_harms_most_goes_first_and_what_only_it_spoilt_stands(conclude, worse, doubted):
    """Beside a name that harms more another is refuted; without it, it is shown."""
    own = {(f, p): -1.0 for f in FAMILIES for p in PLACES}
    own["a", "j"] = worse
    spoiled = {("b", "k"): [(("a", "j"), 2.0 if worse < 1 else 1.5)]}
    found = conclude(Unseen(own, spoiled, frozenset("a" if doubted else "")))
    stands, refuted = groups(found.effects), groups(found.refuted)
    if worse > 1:
        assert stands == own.keys() - {("a", "j")}
        assert refuted == (set() if doubted else {("a", "j")})
    else:  # that which harms most is the other one
        assert ("b", "k") in refuted
        assert ("a", "j") not in stands


def test_where_nothing_is_refuted_all_stands(conclude):
    own = {(f, p): -1.0 for f in FAMILIES for p in PLACES}
    found = conclude(Unseen(own, {}, frozenset()))
    assert groups(found.effects) == own.keys()
    assert found.refuted == ()


def test_a_name_that_is_nowhere_leaves_no_place_of_it(conclude):
    own = {(f, p): -1.0 if f != "a" else 1.0 for f in FAMILIES for p in PLACES}
    found = conclude(Unseen(own, {}, frozenset()))
    assert groups(found.refuted) == {("a", "j"), ("a", "k")}
    assert groups(found.effects) == {g for g in own if g[0] != "a"}
