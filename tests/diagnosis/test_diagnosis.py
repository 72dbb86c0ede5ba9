"""The result: statement, frames, JSON schema, report, fixed values, command line."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import IdentifiabilityError, diagnose

HIDDEN = "stribeck_friction@slider1+slider3=0.03"
#: What it may be, with what it resembles and what no motion here shows.
FEW = ("stribeck_friction", "quadratic_friction", "position_ripple", "torque_offset")
#: What looks like a payload or a tilt: torque that depends on the posture.
OF_POSTURE = (
    "payload", "gravity_tilt", "torque_offset", "joint_stiffness", "gravity_spring",
    "position_ripple",
)  # fmt: skip


@pytest.fixture(scope="session")
def diagnosis(diagnosis_of):
    return diagnosis_of("3-rps", HIDDEN, effects=FEW, forward=True)


def test_the_statement_says_effect_joints_odds_and_how_far_the_gap_shrinks(diagnosis):
    text = diagnosis.details
    assert text.startswith("What is missing? Stribeck friction in slider3 and slider1, up to ")
    assert "goes from" in text
    (effect,) = diagnosis.effects
    most = effect.placements[0]
    assert f"{100 * most.share:.2g} % of the force variation of {most.joint}" in text
    assert "hardly determine" in text  # its sizes lie within two standard errors
    sure = tuple(replace(p, errors=0.0 * p.values) for p in effect.placements)
    known = replace(diagnosis, effects=(replace(effect, placements=sure),))
    assert "hardly determine" not in known.details


def test_json_follows_the_schema(diagnosis):
    content = diagnosis.to_dict()
    (effect,) = content["effects"]
    assert effect["effect"] == "stribeck_friction"
    assert sorted(effect["joints"]) == ["slider1", "slider3"]
    assert effect["error_ra_validation_after"] < effect["error_ra_validation_before"]
    assert effect["log_odds"] > 1 < effect["log_odds_unseen"]
    own = next(x for x in diagnosis.evidence if (x.name, x.place) == (FEW[0], "slider1"))
    assert own.before > 1
    assert np.isnan(own.after)  # the model has it


def test_a_name_that_the_verifying_motion_contradicts_is_listed_as_refuted(logs_of, tmp_path):
    """The robot that verifies has nothing of what the fitted one has, so adding it does harm."""
    ripple = "position_ripple@left_shoulder"
    fitted = logs_of("five-bar", f"{ripple}=0.05")[:4]
    held = logs_of("five-bar")[4]
    d = diagnose("five-bar", fitted, held, effects=["position_ripple"], quick=True)
    (refuted,) = d.refuted
    assert refuted.before > 1 > refuted.unseen
    assert d.to_ladder().models[0].refuted == [ripple]
    assert d.model.names == d.base
    assert "Position ripple in left_shoulder stood out" in d.details
    page = d.write_report(tmp_path / "d.html").read_text()
    assert "Not confirmed by the motion that verifies" in page
    assert "Values of each joint" in page


def test_a_fixed_simulation_can_miss_a_payload(diagnosis_of, named):
    d = diagnosis_of("two-link", "payload=0.1", fixed=True, effects=OF_POSTURE, forward=True)
    assert named(d) == [("payload", ("link2",))]
    without = diagnosis_of("two-link", fixed=True, effects=OF_POSTURE)
    assert d.held_after < 1.2 * without.held_before
    assert without.effects == ()
    assert "the robot file's own values" in without.details


def test_only_the_families_that_are_asked_for_are_named(logs_of):
    logs = logs_of("3-rps", HIDDEN)
    d = diagnose("3-rps", logs[:4], logs[4:], effects=["position_ripple"], quick=True)
    assert {e.name for e in d.effects} <= {"position_ripple"}
    with pytest.raises(IdentifiabilityError, match="no effect 'ripple'"):
        diagnose("3-rps", logs[:1], effects=["ripple"])
    with pytest.raises(IdentifiabilityError, match="at least one"):
        diagnose("3-rps", [])
