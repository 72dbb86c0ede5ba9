"""A model file is a ladder of one model: every verb takes it, and says what it used."""

import hashlib
import json

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model, Robot, analyze, prune
from identifiability.regression.reduction import build_ladder, ladder_text, model_entry, read_ladder
from identifiability.regression.structure import Structure, random_motion


def test_a_pruned_model_is_one_model_that_is_judged_beside_the_full_model(arm_log, tmp_path):
    pruned = prune("two-link", arm_log, replicates=0, force=["shoulder.Fv"])
    path = pruned.write_model(tmp_path / "model.toml")
    assert len(read_ladder(path).models) == 1
    for ladder in (path, pruned):
        again = analyze("two-link", arm_log, ladder=ladder, replicates=0)
        full, model = again.models
        assert len(full.submodel) == len(again.base) > len(model.submodel)
        assert model.submodel.columns == pruned.chosen.columns
        assert_allclose(model.estimate.value, pruned.chosen.estimate.value, rtol=1e-9, atol=1e-12)
    assert (
        prune("two-link", arm_log, ladder=pruned, replicates=0).full.columns
        == pruned.chosen.columns
    )


def test_a_model_with_every_reduction_is_written_and_read_back_as_it_was(tmp_path, two_link):
    path = tmp_path / "ladder.toml"
    path.write_text(
        '[[models]]\nname = "a \\"quoted\\" name"\nzero = ["shoulder.Fv"]\n'
        'hold = {"elbow.Fv" = 0.25, "link2.mx" = "nominal"}\n'
        'tie = {"elbow.Fc" = ["elbow.Fc+", "elbow.Fc-"]}\n'
        '[[models]]\nname = "b"\nzero = ["elbow.Fc"]\n'
    )
    model = Model.of("rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia")
    structure = Structure.of(two_link, model)
    for submodel in build_ladder(read_ladder(path), structure):
        entry = read_ladder(path).model_copy(update={"models": [model_entry(submodel, structure)]})
        written = tmp_path / "written.toml"
        written.write_text(ladder_text(entry, "a comment"))
        (again,) = build_ladder(read_ladder(written), structure)
        assert again.columns == submodel.columns
        assert_array_equal(again.M, submodel.M)
        assert_array_equal(again.fixed, submodel.fixed)


def test_a_place_may_be_a_pattern_and_a_named_place_goes_before_it():
    robot = Robot.load("3-rps")
    texts = (
        "viscous_friction@slider*",
        "stribeck_friction@*:0.5",
        "stribeck_friction@slider2:0.02",
    )
    viscous, stribeck = Model.of(*texts).effects
    assert [p.name for p in viscous.parameters(robot)] == [f"slider{k}.Fv" for k in (1, 2, 3)]
    shapes = {f"slider{k}.stribeck_friction": 0.02 if k == 2 else 0.5 for k in (1, 2, 3)}
    assert stribeck.shapes(robot) == shapes
    assert [p.name for p in stribeck.parameters(robot)] == [
        "slider1.Fs",
        "slider3.Fs",
        "slider2.Fs",
    ]
    motion = random_motion(robot, np.random.default_rng(0), 20)
    W = Model((stribeck,)).regressor(robot, motion)
    for column, k in enumerate((0, 2, 1)):
        speed = motion.actuated_v[:, k]
        shape = shapes[f"slider{k + 1}.stribeck_friction"]
        own = np.exp(-np.abs(speed) / shape) * np.sign(speed)
        assert_allclose(W[:, k, column], own)
        assert np.count_nonzero(W[:, :, column].any(axis=0)) == 1


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("coulomb_friction@elbow:0.1", "coulomb_friction has no shape"),
        ("stribeck_friction@elbw:0.1", "has no parameter at 'elbw' of two-link"),
    ],
)
def test_effects_that_cannot_live_there_are_refused(text, sentence, rejected, two_link):
    with rejected(sentence):
        Model.of("rigid_body", text).parameters(two_link)


def test_provenance_names_the_ladder_beside_the_robot_and_all_that_decided(
    arm_log, tmp_path, two_link
):
    for part in (two_link.path, two_link.sidecar):
        (tmp_path / part.name).write_bytes(part.read_bytes())
    (tmp_path / "ladder.toml").write_text('[[models]]\nname = "mine"\n')
    beside = Robot.load(tmp_path / two_link.path.name)
    result = analyze(beside, arm_log, replicates=0, cad_prior=0.5, method="ols")
    found = json.loads(json.dumps(result.to_dict()["provenance"]))
    ladder = beside.path.with_name("ladder.toml")
    assert result.chosen.name == "mine"
    assert found["ladder"] == "ladder.toml"
    assert found["sha256 ladder"] == hashlib.sha256(ladder.read_bytes()).hexdigest()
    assert found["sidecar"] == beside.sidecar.name
    sidecar = hashlib.sha256(beside.sidecar.read_bytes()).hexdigest()
    assert found[f"sha256 {beside.sidecar.name}"] == sidecar
    assert {"pin", "mujoco", "numpy", "clarabel", "identifiability"} <= set(found)
    decided = ("method", "cad_prior", "replicates", "seed")
    assert [found[k] for k in decided] == ["ols", "0.5", "0", "0"]
