"""Fixed tendons of a compiled MJCF: sums of joints, and the equalities between them."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import mujoco
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError
from identifiability.robot.coupled import couple
from identifiability.robot.parts import Coupling, Term

_ALONG = int(mujoco.mjtWrap.mjWRAP_JOINT)


def find_arms(m: Any, t: int) -> dict[int, float] | None:
    """Return the joints that a tendon runs along, with their coefficients; None of a bent one."""
    start = int(m.tendon_adr[t])
    parts = range(start, start + int(m.tendon_num[t]))
    if any(int(m.wrap_type[w]) != _ALONG for w in parts):
        return None
    arms: dict[int, float] = {}
    for w in parts:
        joint = int(m.wrap_objid[w])
        arms[joint] = arms.get(joint, 0.0) + float(m.wrap_prm[w])
    return {j: c for j, c in arms.items() if c}


def read_tendon_coupling(path: Path, m: Any, k: int, actuated: Collection[str]) -> Coupling:
    """Return an equality between fixed tendons as a coupling of joints.

    MuJoCo demands ``L₁ − L₁₀ = Σ c_i (L₂ − L₂₀)^i``, with the lengths in the reference position. It
    is solved for a joint of the first tendon, one that no motor drives if there is any.

    Raises
    ------
    RobotError
        If a tendon does not run along joints.
    """
    ends: list[tuple[dict[str, float], float]] = []
    for t in (int(m.eq_obj1id[k]), int(m.eq_obj2id[k])):
        arms = {} if t < 0 else find_arms(m, t)
        if arms is None:
            raise RobotError(
                f"{path} couples the tendon '{m.tendon(t).name}', which does not run along joints; "
                "only <fixed> tendons can be coupled."
            )
        weights = {m.joint(j).name: c for j, c in arms.items()}
        ends.append((weights, 0.0 if t < 0 else float(m.tendon_length0[t])))
    (first, length), (second, start) = ends
    if not first:
        raise RobotError(f"{path} couples a tendon that no joint moves; take the equality out.")
    joint = next((j for j in first if j not in actuated), next(iter(first)))
    arm = first.pop(joint)
    poly = Polynomial(m.eq_data[k, :5])
    if second:
        poly = poly(Polynomial([-start, 1.0]))
    terms = [
        Term({}, (length / arm,)),
        Term({j: -c / arm for j, c in first.items()}, (0.0, 1.0)),
        Term(second, tuple(float(c) / arm for c in (poly.coef if second else poly.coef[:1]))),
    ]
    return couple(m.equality(k).name or joint, joint, terms)
