"""What no name explains is learned as a function, and said to have none."""

import numpy as np
import pytest

from identifiability import analyze, diagnose
from identifiability.effects import FAMILIES

FUNCTIONS = tuple(name for name, family in FAMILIES.items() if family.unnamed)
#: What the planted friction would be called.
HELD_BACK = ("rising_friction", "sigmoid_friction")
KNOWN = ("stribeck_friction", "quadratic_friction", "position_ripple", "joint_stiffness")


def test_friction_without_a_name_is_learned_and_confirmed(logs_of, tmp_path):
    logs = logs_of("five-bar", "rising_friction@left_shoulder=0.1")
    d = diagnose("five-bar", logs[:4], logs[4], effects=[*KNOWN, *FUNCTIONS], forward=False)
    effect = d.effects[0]  # names may refine it
    assert (effect.name, effect.joints) == ("function_of_velocity", ("left_shoulder",))
    named = diagnose("five-bar", logs[:4], logs[4], effects=HELD_BACK, forward=False)
    assert named.effects[0].name in HELD_BACK
    gap = d.held_before - named.held_after
    assert d.held_before - d.held_after > 0.9 * gap
    assert "An unnamed function of velocity in left_shoulder, up to 1.0" in d.details
    assert "left_shoulder better than any known effect does. Nearest to it" in d.details
    # What was learned is the curve but for Coulomb and viscous friction, which are in the model.
    curve = d.curves[0]
    assert (curve.against, curve.of) == ("velocity", 0)
    v = curve.x
    truth = -np.sign(v) * np.exp(-np.abs(v) / (0.3 * np.sqrt(np.mean(v**2))))
    like = np.column_stack([np.ones_like(v), v, np.sign(v)])
    left = [y - like @ np.linalg.lstsq(like, y, rcond=None)[0] for y in (curve.learned, truth)]
    assert np.corrcoef(*left)[0, 1] > 0.9
    # The model that is given away has it, and its file is read again.
    assert "function_of_velocity" in d.model.names
    path = d.write_model(tmp_path / "model.toml")
    judged = analyze("five-bar", logs[:4], logs[4], path, replicates=0).models[0]
    assert judged.error_ra_validation == pytest.approx(d.held_after, rel=1e-6)
    assert (
        f"function_of_velocity.fo1+fo2+fo3+fo4@left_shoulder:{effect.placements[0].shape!r}"
        in (tmp_path / "model.toml").read_text()
    )


@pytest.mark.parametrize(
    "hidden, found",
    [("free_spring", "function_of_position"), ("torque_offset", "torque_offset")],
)
def test_an_offset_is_a_part_of_a_spring_without_a_name_and_else_an_offset(
    logs_of, named, hidden, found
):
    """The offset is named first, as it is cheaper; of a spring it leaves half of the error."""
    logs = logs_of("two-link", f"{hidden}@elbow=0.1")
    known = ["torque_offset", "coulomb_asymmetry", *FUNCTIONS]
    d = diagnose("two-link", logs[:4], logs[4], effects=known, forward=False)
    assert named(d) == [(found, ("elbow",))]
