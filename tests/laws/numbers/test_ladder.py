"""Models as a ladder file states them: zeroed, held, tied, kept, over named groups."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model
from identifiability.foundation.names import Parameter
from identifiability.regression.reduction import (
    LadderEntry,
    build_ladder,
    default_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure, group_columns

NOMINAL = {"arm.m": 2.0, "arm.mx": 0.3, "arm.Ixx": 0.5, "arm.Fv": 7.0, "arm.Fc+": 1.0}
ROBOT = SimpleNamespace(nominal=NOMINAL)


@pytest.fixture(scope="module")
def base():
    """Four groups; arm.Ixx acts like three times arm.m."""
    W = np.random.default_rng(0).normal(size=(60, 5))
    W[:, 2] = 3 * W[:, 0]
    kinds = (("m", "kg"), ("mx", "kg·m"), ("Ixx", "kg·m²"), ("Fc+", "N·m"), ("Fc-", "N·m"))
    return group_columns(W, [Parameter("arm", k, u, "x", nonnegative=k != "mx") for k, u in kinds])


def submodels(base, *entries):
    return build_ladder(
        LadderEntry(models=[{"name": "full"}, *entries]), Structure(ROBOT, Model(()), base)
    )


def test_zeroed_parameters_are_left_out_and_held_ones_keep_their_value(base):
    submodel = submodels(base, {"name": "r", "zero": ["arm.mx"], "hold": {"arm.Fc+": 0.4}})[1]
    assert submodel.columns == ("arm.m", "arm.Fc-")
    assert_array_equal(submodel.fixed, [0, 0, 0.4, 0])
    assert_array_equal(submodel.expand(np.array([5.0, 6.0])), [5, 0, 0.4, 6])


def test_nominal_is_the_value_of_the_whole_group(base):
    """m + 3 Ixx = 2 + 1.5."""
    submodel = submodels(base, {"name": "r", "hold": {"arm.m": "nominal"}})[1]
    assert_allclose(submodel.fixed, [3.5, 0, 0, 0])
    assert_allclose(Structure(ROBOT, Model(()), base).nominal_base, [3.5, 0.3, 1.0, 0.0])


def test_a_pattern_is_all_that_fit_it_and_a_name_goes_before_it(base, rejected):
    zero, hold, tie, keep = submodels(
        base,
        {"name": "a", "zero": ["arm.m*"]},
        {"name": "b", "from": "full", "hold": {"arm.Fc?": 0.5, "arm.Fc-": 2.0, "*.mx": "nominal"}},
        {"name": "c", "from": "full", "tie": {"arm.Fc": ["arm.Fc*"]}},
        {"name": "d", "from": "full", "keep": ["*.mx", "arm.Fc+"]},
    )[1:]
    assert zero.columns == ("arm.Fc+", "arm.Fc-")
    assert hold.columns == ("arm.m",)
    assert_array_equal(hold.fixed, [0, 0.3, 0.5, 2.0])
    assert tie.columns == ("arm.m", "arm.mx", "arm.Fc")
    assert (tie.units[2], tie.labels[2]) == ("N·m", "Fc+(arm) = Fc-(arm)")
    assert_array_equal(tie.expand(np.array([1.0, 2.0, 3.0])), [1, 2, 3, 3])
    assert keep.columns == ("arm.mx", "arm.Fc+")
    with rejected(r"names the parameter 'leg\*', which is not there"):
        submodels(base, {"name": "e", "zero": ["leg*"]})


def test_only_the_first_model_names_effects(rejected):
    two = LadderEntry(models=[{"name": "a"}, {"name": "b", "effects": ["rigid_body"]}])
    with rejected("The model 'b' names effects, but a ladder reduces one"):
        ladder_model(two)
    one = LadderEntry(models=[{"name": "a", "effects": ["rigid_body"]}])
    assert ladder_model(one).names == ("rigid_body",)


def test_the_default_ladder_ends_without_offsets_and_none_is_named_where_mass_stands_for_it(
    two_link,
):
    entry = default_ladder(two_link)
    full, none = build_ladder(entry, Structure.of(two_link, ladder_model(entry)))
    assert set(full.columns) - set(none.columns) == {"shoulder.off", "elbow.off"}
    base = Structure.of(two_link, ladder_model(entry)).base
    alone = replace(base, kept=base.kept[:-2], G=base.G[:-2])
    assert not any(n.endswith(".off") for n in alone.names)
    first, second = build_ladder(entry, Structure(two_link, Model(()), alone))
    assert first.columns == second.columns
