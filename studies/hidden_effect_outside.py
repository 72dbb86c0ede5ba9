"""Effects that `hidden_effect.py` holds back from the dictionary, so that they have no name."""

from __future__ import annotations

from identifiability.effects import FAMILIES

#: All that may be named.
EVERY = tuple(FAMILIES)
#: Effects that are held back from the dictionary, with acceptable other names for each.
OUTSIDE = {
    "rising_friction": ("sigmoid_friction",),
    "sigmoid_friction": ("rising_friction",),
    "stribeck_friction": (),
    "quadratic_friction": ("stribeck_friction",),
    "velocity_leak": (),
    "torque_scale": (),
    "load_dependent_friction": ("position_friction",),
    "position_friction": ("load_dependent_friction",),
    "torque_leak": (),
    "hysteresis": (),
    "backlash": (),
    "friction_drift": (),
    "thermal_drift": ("torque_drift",),
}
#: Those of them that are smooth functions of coordinates of a diagnosis.
SMOOTH = tuple(OUTSIDE)[:8]
