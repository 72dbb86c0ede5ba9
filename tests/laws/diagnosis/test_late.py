"""The second pass: what it may name, beside what, at which level."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose import late
from identifiability.workflows.diagnose.gates import Naming, Step
from identifiability.workflows.diagnose.material import Rules


@pytest.fixture
def search(monkeypatch, candidate):
    """The second pass after some refused names; says what each search was asked."""
    like, missing = candidate("like", "j", 0), candidate("missing", "j", 1, late=True)
    other, elsewhere = candidate("other", "j", 2), candidate("like", "l", 3)
    families = [like.family, missing.family]
    every = (like, missing, other, elsewhere)
    wider = SimpleNamespace(candidates=every, bench=None, held=None)
    rules, structure = Rules(level=0.04), SimpleNamespace(present=())
    setting = SimpleNamespace(rules=rules, structure=structure)
    material = SimpleNamespace(setting=setting, held=None, anew=lambda *_: wider)

    def run(refused, found, named=(), pass_late=True):
        asked = []

        def name_effects(bench, options, held, rules, present, say, start):
            asked.append(([*map(every.index, options)], [*map(every.index, start)], rules.level))
            step = Step({}, 1.0, ("missing", "j"), 0.01 * len(asked))
            chosen = (missing if pass_late else other,) * found
            return Naming(chosen, {("missing", str(len(asked))): 0.01}, (step,))

        told = {
            "name_effects": name_effects, "find_families": lambda _: families,
            "_asks": lambda *_: True,
            "predicts_better": lambda *_: True, "_settle_knots": lambda held, naming, _: naming,
        }  # fmt: skip
        for name, stub in told.items():
            monkeypatch.setattr(late, name, stub)
        given = [like][:refused]
        rng = np.random.default_rng(0)
        p_values = {("like", "j"): 0.01, ("other", "j"): 0.02}
        before = Naming(tuple(every[k] for k in named), {} if pass_late else p_values, ())
        return asked, late.name_late(material, before, rng, refused=given)[1]

    return run


def test_what_resembles_a_late_name_waits_for_it_in_a_joint_where_a_name_was_refused(search):
    asked, naming = search(refused=1, found=1)
    assert asked == [([1, 3], [], 0.04), ([0, 1, 2, 3], [1], 0.04)]
    assert [s.p_value for s in naming.steps] == [0.01, 0.02]
    assert set(naming.p_values) == {("missing", "1"), ("missing", "2")}
    # Where nothing late is there all stay out but what is named; where nothing was refused none do.
    assert search(refused=1, found=0, named=[2])[0] == [([1, 2, 3], [2], 0.04)]
    assert search(refused=0, found=1)[0] == [([0, 1, 2, 3], [], 0.04)]


def test_fewer_names_of_the_second_pass_take_the_place_of_those_of_the_first(search):
    """Without a late one among them; as many names are those of the first pass."""
    first = ["like", "other"]
    for found, kept in ((1, ["other"]), (2, first), (3, first)):
        asked, naming = search(refused=0, found=found, named=[0, 2], pass_late=False)
        assert len(asked) == 1
        assert [c.family.name for c in naming.chosen] == kept
    # What was joined has the p-value of the least sure of what it was.
    _, naming = search(refused=0, found=1, named=[0, 2], pass_late=False)
    assert naming.p_values["other", "j"] == 0.02


@pytest.mark.parametrize(
    ("nothing", "first", "second", "better"),
    [(1.0, 0.9, 0.89, True), (1.0, 0.9, 0.91, False), (1.0, 1.1, 1.0, False),
     (1.0, None, 0.9, True), (1.0, None, 0.999, False)],
)  # fmt: skip
def test_what_takes_the_place_of_a_name_is_better_and_surely_better_than_nothing(
    candidate, nothing, first, second, better
):
    """The errors of 240 rows, each off by a tenth, without any name, with a first and a second."""
    old, new = candidate("old", "j", 0), candidate("new", "j", 1, late=True)
    scatter = 0.1 * np.random.default_rng(0).standard_normal((3, 240))
    scatter -= scatter.mean(1, keepdims=True)
    errors = {(): nothing + scatter[0], ("old",): (first or 0) + scatter[1]}
    errors["new",] = second + scatter[2]

    class Told:
        def errors(self, chosen, *, real):
            assert real
            return errors[tuple(c.family.name for c in chosen)]

    before = Naming((old,) if first else (), {}, ())
    after = Naming((new,), {}, ())
    assert late.predicts_better(Told(), before, Told(), after, 0.002) == better


@pytest.mark.parametrize(
    ("shares", "sure", "causes", "asks"),
    [
        (({"velocity": 0.02, "session": 0.02}, {"log": 0.5}), False, set(), False),
        (({"velocity": 0.02}, {"session": 0.04}), False, {"session"}, False),
        (({"session": 0.04}, {}), True, {"session", "anything"}, True),
        (
            ({"session": 0.04, "load": 0.04}, {"time": 0.04}),
            False,
            {"session", "load", "time"},
            True,
        ),
        (({}, {}), True, {"anything"}, True),
    ],
)
def test_a_search_is_asked_for_by_what_is_left_but_not_by_the_session_alone(
    monkeypatch, shares, sure, causes, asks
):
    found = [SimpleNamespace(explained=explained) for explained in shares]
    monkeypatch.setattr(late, "find_discrepancies", lambda *_: found)
    structure = SimpleNamespace(robot=SimpleNamespace(joints=("j", "l")))
    material = SimpleNamespace(
        held=SimpleNamespace(fitted_residual=lambda _: None), train=None,
        setting=SimpleNamespace(structure=structure),
        remains=lambda _: SimpleNamespace(anything=sure),
    )  # fmt: skip
    assert late.what_is_left(material, Naming((), {}, ())) == causes
    assert late._asks(material, Naming((), {}, ())) == asks
