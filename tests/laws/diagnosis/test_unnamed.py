"""What takes the place of a name: functions where it does not fit, nothing where noise made it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose import name_curves, unnamed, words
from identifiability.workflows.diagnose.findings import NamedEffect
from identifiability.workflows.diagnose.gates import Naming, Nearest
from identifiability.workflows.diagnose.held_out import Gain, HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.naming import name_effects
from identifiability.workflows.diagnose.shown import Both, Shown


@pytest.mark.parametrize(
    ("levels", "fits"), [((20.0, 0.0), True), ((20.0, 12.0), False), ((20.0, 2.0), True)]
)
def test_a_name_fits_unless_a_function_at_its_place_surely_explains_what_it_leaves(
    world, candidate, levels, fits
):
    e = world.basis
    noise = np.random.default_rng(1).standard_normal(world.rows)
    rows = world.make(e[:, :2] @ levels + noise - e @ (e.T @ noise), list(e[:, :3].T))
    name, function = candidate("a", "j", 0), candidate("f", "j", 0, 1, 2, unnamed=True)
    every = candidate("dry", "j", 0, basic=True)
    away = [candidate(f"g{k}", "l", 1, 2, unnamed=True) for k in range(3)]
    m = SimpleNamespace(bench=world.bench(rows, 199), held=world.held(rows))
    m.candidates = (name, function, *away)
    assert unnamed.keep_fitting(m, [name], 0.01) == (name,) * fits
    # Functions elsewhere ask nothing of it, and what every joint has is there whatever else is.
    m.candidates = (name, *away)
    assert unnamed.keep_fitting(m, [name], 0.01) == (name,)
    m.candidates = (every, function)
    assert unnamed.keep_fitting(m, [every], 0.01) == (every,)


def test_places_share_the_level_at_which_names_are_doubted(world, candidate):
    """One draw in 200 reaches as much: that is below .006, and above the half of it."""
    e = world.basis
    noise = np.random.default_rng(1).standard_normal(world.rows)
    rows = world.make(e[:, :2] @ (20.0, 12.0) + noise - e @ (e.T @ noise), list(e[:, :4].T))
    name, function = candidate("a", "j", 0), candidate("f", "j", 0, 1, 2, unnamed=True)
    other = candidate("b", "l", 3)
    m = SimpleNamespace(bench=world.bench(rows, 199), held=world.held(rows))
    m.candidates = (name, other, function)
    assert unnamed.keep_fitting(m, [name], 0.006) == ()
    assert unnamed.keep_fitting(m, [name, other], 0.006) == (name, other)
    assert unnamed.keep_fitting(m, [name, other], 0.012) == (other,)


@pytest.mark.parametrize(
    ("late", "fits", "share", "given"),
    [(False, True, 0.5, False), (False, False, 0.01, True), (False, False, -0.01, False),
     (True, True, 0.01, False), (True, True, 0.03, True), (True, False, 0.01, True),
     (True, False, -0.01, False)],
)  # fmt: skip
def test_a_function_in_the_stead_of_a_name_that_does_not_fit_predicts_better_if_not_surely(
    monkeypatch, candidate, late, fits, share, given
):
    """Gains are known to 0.02; in the stead of a late name that fits it is surely better."""
    name, function = candidate("a", "j", 0, late=late), candidate("f", "j", 1, unnamed=True)
    chosen = searched(
        monkeypatch, name, function, lambda start: start or (function,), Gain(share, 0.02), fits
    )
    assert chosen == ((function,) if given else (name,))


@pytest.mark.parametrize(
    ("name", "place", "share", "given"),
    [("part", "j", 0.01, True), ("part", "j", -0.01, False), ("part", "l", 0.05, False),
     ("else", "j", 0.05, False)],
)  # fmt: skip
def test_what_every_joint_has_gives_way_to_a_function_that_contains_it_and_predicts_better(
    monkeypatch, candidate, name, place, share, given
):
    """An offset to a spring in its own joint; not to one elsewhere, nor does friction."""
    basic, function = candidate(name, place, 0, basic=True), candidate("f", "j", 1, unnamed=True)
    function.family.effect.supersedes = ("part",)
    chosen = searched(monkeypatch, basic, function, lambda start: (function,), Gain(share, 0.02))
    assert chosen == ((function,) if given else (basic,))


@pytest.mark.parametrize(
    ("against", "flexible", "function", "of", "place", "fits", "given"),
    [("position", True, "function_of_position", "position", "j", True, False),
     ("position", True, "function_of_position", "position", "j", False, True),
     ("position", True, "function_of_position", "position", "l", True, True),
     ("position", True, "function_of_time", "time", "j", True, True),
     ("position", False, "function_of_position", "position", "j", True, True),
     ("time", False, "function_of_time", "time", "j", True, False),
     ("time", False, "function_of_time", "time", "j", False, True),
     ("time", False, "function_of_time", "time", "l", True, True),
     ("time", False, "function_of_position", "position", "j", True, True)],
)  # fmt: skip
def test_a_function_is_not_given_for_a_curve_or_a_drift_of_its_joint_that_fits(
    monkeypatch, candidate, against, flexible, function, of, place, fits, given
):
    """They say the same, and one has a name."""
    name = candidate("name", "j", 0, late=True, flexible=flexible, against=against)
    new = candidate(function, place, 1, unnamed=True, against=of)
    chosen = searched(monkeypatch, name, new, lambda start: (new,), Gain(0.1, 0.02), fits)
    assert chosen == ((new,) if given else (name,))


@pytest.mark.parametrize(
    ("level", "names", "given"),
    [(0.0, 2, True), (6.0, 2, False), (6.0, 1, False), (0.0, 1, False)],
)
def test_a_function_is_given_for_two_names_of_one_position_unless_the_data_decide_for_these(
    monkeypatch, world, candidate, level, names, given
):
    """It predicts a little worse and has a column more; nothing is left beside the names.

    They say what it says and the square of the level beside it.
    """
    e = world.basis
    two = [candidate(n, "j", k, against="position") for k, n in enumerate(("a", "b"))]
    function = candidate("f", "j", 2, 3, 4, unnamed=True, against="position")
    columns = [e[:, 0], e[:, 1], world.unit(1, 0, 1), e[:, 1], e[:, 3]]
    if not level:
        columns[2] = e[:, 0]
    torque = e[:, :2] @ ((level or 10.0), 10.0)
    bench = world.bench(world.make(torque, columns), 2)
    chosen = searched(
        monkeypatch, tuple(two[:names]), function, lambda start: start or (function,),
        Gain(-0.05, 0.02), bench=bench, left=False,
    )  # fmt: skip
    assert chosen == ((function,) if given else tuple(two[:names]))


def searched(monkeypatch, name, function, search, gain, fits=True, bench=None, left=True):
    """Return what is named where a search finds a function beside a name or in its stead."""
    names = name if isinstance(name, tuple) else (name,)
    wider = SimpleNamespace(candidates=(*names, function), bench=bench, held=None)
    wider.white = bench and bench.plain
    structure = SimpleNamespace(present=())
    setting = SimpleNamespace(rules=Rules(), structure=structure)
    material = SimpleNamespace(setting=setting, held=None, candidates=(*names, function))
    material.anew, material.extended = lambda *_: wider, lambda *_: material

    def name_effects(bench, options, held, rules, present, say, start):
        return Naming(search(tuple(start)), {}, ())

    told = {
        "find_families": lambda _: [function.family],
        "what_is_left": lambda *_: {"velocity"} if left else set(),
        "name_effects": name_effects, "_begin": lambda *_: [],
        "keep_fitting": lambda m, named, level: tuple(named) * fits, "_nearest": lambda *_: (),
        "gain_over": lambda *_: gain,
    }  # fmt: skip
    for what, stub in told.items():
        monkeypatch.setattr(unnamed, what, stub)
    monkeypatch.setattr(name_curves, "is_curved", lambda *_: True)
    before = Naming(names, {}, ())
    return unnamed.name_unnamed(material, before, np.random.default_rng(0))[1].chosen


def test_what_is_useful_beside_what_cannot_be_is_asked_again_without_it(world, candidate):
    errors = {(): 1.0, ("a",): 1.1, ("b",): 0.9, ("a", "b"): 0.5}
    possible = {(): 1.0, ("a",): 0.9, ("b",): 1.0, ("a", "b"): 0.899}

    class Told(HeldOut):
        """Where bodies must be possible the second one gains nothing."""

        def errors(self, chosen, *, real=False, beside=None):
            names = tuple(sorted(c.family.name for c in chosen))
            return np.full(100, (possible if real else errors)[names])

    e = world.basis
    rows = world.make(e[:, :2] @ [60.0, 40.0], [e[:, 0], e[:, 1]])
    held = Told(train=rows, choosing=replace(rows), real=object())
    options = [candidate("a", "j", 0), candidate("b", "j", 1)]
    assert name_effects(world.bench(rows, 99), options, held, Rules()).chosen == ()
    errors["a",] = 0.95
    assert name_effects(world.bench(rows, 99), options, held, Rules()).chosen == (options[0],)


def test_both_motions_together_say_what_noise_would_make(candidate):
    assert Both(0.02, 1.0, 0.05).chance == pytest.approx(0.02 / np.e)
    for p, evidence, unlikely in ((0.02, -1.0, True), (0.02, -0.9, False), (0.005, -2.0, False),
                                  (0.005, -2.4, True), (np.nan, -9.0, False)):  # fmt: skip
        both = Both(p, evidence, 0.05)
        assert both.unlikely == unlikely
        assert not both.likely
    assert Both(0.02, 0.1, 0.05).likely
    assert not Both(0.05, 0.1, 0.01).likely
    assert Both(0.05, -1e6, 0.05).unlikely


@pytest.mark.parametrize(
    ("function", "evidence", "after", "refuted"),
    [(False, -1.0, 0.19, True), (False, -0.5, 0.21, False), (True, -0.1, 0.19, True),
     (True, 0.9, 0.19, False), (True, 0.5, 0.19, True), (True, 0.9, 0.21, True)],
)  # fmt: skip
def test_what_noise_makes_too_often_is_refuted_and_what_it_does_not_needs_no_more(
    function, evidence, after, refuted
):
    """Of p = 0.02; nothing that was shown is sure by itself."""
    effect = NamedEffect(name="a", title="A", placements=(), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.1), shown=Shown(0.2, after, (-0.3, 0.1), -0.1),
                         unnamed=function, rare=function,
                         both=Both(0.02, evidence, 0.01 if function else 0.05))  # fmt: skip
    assert not effect.confirmed
    assert effect.refuted == refuted
    assert not replace(effect, joints_interval=(-0.5, -0.1)).refuted


@pytest.mark.parametrize(
    ("evidence", "interval", "said"),
    [
        (-1.0, (-0.3, 0.1), "too little speaks for it: on both motions together noise does as much "
         "in 5.4 % of logs, where 5 % are allowed."),
        (-9.0, (-0.3, 0.1), "noise does as much in 100 % of logs"),
        (-1.0, (0.1, 0.3), "it raises the error of its joints"),
        (1.0, (-0.3, 0.1), "the error of its joints, each on its own scale, only goes"),
    ],
)  # fmt: skip
def test_a_refuted_name_has_the_reason_for_which_it_was_refuted(evidence, interval, said):
    place = SimpleNamespace(place="j", p_value=0.02, rivals=(), rows=(), open=())
    effect = NamedEffect(name="a", title="A", placements=(place,), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.1), shown=Shown(0.2, 0.19, interval, -9.0, 0.1),
                         rare=True, both=Both(0.02, evidence, 0.05))  # fmt: skip
    assert effect.refuted
    assert said in words._state_contradicted(effect, "motion 5")


def test_of_a_torque_that_never_changes_no_error_is_told():
    none = Shown(np.nan, np.nan, (np.nan, np.nan), np.nan)
    place = SimpleNamespace(place="j", p_value=0.02, rivals=(), rows=(), open=())
    effect = NamedEffect(name="a", title="A", placements=(place,), before=0.2, after=0.1,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.1,
                         joints_interval=(-0.5, 0.1), shown=none,
                         both=Both(0.02, 1.0, 0.05))  # fmt: skip
    said = words._state_contradicted(effect, "motion 5")
    assert said.endswith("refuted: on motion 5 the torque where it is never changes there.")


def test_the_nearest_names_are_said_to_predict_better_where_they_do():
    near = (Nearest("B", 0.076), Nearest("C", -0.074))
    effect = SimpleNamespace(nearest=near, joints=("j",), title="an unnamed function of time")
    told = words._state_nearest(effect)
    assert told.startswith("No name fits this function of time in j; ")
    assert told.endswith("is another: B (7.6 % more) and C (7.4 % less).")


@pytest.mark.parametrize(
    ("evidence", "news", "opposed"),
    [(-1.2, (-1.0, 2.0), True), (-1.1, (-1.0, 2.0), False), (-1.2, (0.1, 2.0), False),
     (-1.2, (-4.0, 4.1), False), (-1.2, (-4.0, 3.9), True), (-1.2, (np.nan, np.nan), False)],
)  # fmt: skip
def test_a_name_for_which_unseen_motion_says_nothing_is_refuted_where_it_could(
    evidence, news, opposed
):
    """By half a decade; it could where it tells the size within four times itself.

    What it confirms is not asked.
    """
    place = SimpleNamespace(place="j", p_value=0.005, rivals=(), rows=(), open=())
    shown = Shown(0.2, 0.201, (-0.3, 0.1), -0.01, strength=4.0, news=news)
    effect = NamedEffect(name="a", title="A", placements=(place,), before=0.2, after=0.19,
                         interval=(-1.0, 1.0), joints_before=0.2, joints_after=0.19,
                         joints_interval=(-0.5, 0.1), shown=shown,
                         both=Both(0.005, evidence, 0.05))  # fmt: skip
    assert not effect.both.unlikely
    assert effect.refuted == opposed
    assert not replace(effect, joints_interval=(-0.5, -0.1)).refuted
    if opposed:
        said = words._state_contradicted(effect, "motion 5")
        assert said.endswith(
            "likelier without it (likelihood ratio 0.3), and nothing of it is surely there."
        )
