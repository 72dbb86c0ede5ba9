"""A torque column of coupled motors that has a wrong sign or name is told, and a right one not."""

from dataclasses import replace

import numpy as np
import pytest

from .conftest import record


@pytest.mark.parametrize(
    ("columns", "signs", "said"),
    [
        ([0, 1], [1, 1], ()),
        ([0, 1], [1, -1], ("right seems to have the wrong sign",)),
        ([0, 1], [-1, 1], ("left seems to have the wrong sign",)),
        ([1, 0], [1, 1], ("left and right seem to be exchanged",)),
    ],
)
def test_columns_of_coupled_motors(columns, signs, said, say):
    structure, log = record("differential-wrist")
    gear = structure.robot.transmission
    motors = log.tau @ np.linalg.inv(gear.ratio[:, None] * gear.coupling)
    q = gear.motor_rate(log.q - gear.offset)
    spoilt = replace(log, q=q, tau=motors[:, columns] * signs, joints=gear.motors)
    hints = [x for x in say(structure, spoilt) if x.key == "motor"]
    assert len(hints) == len(said)
    assert all(part in hint for part, hint in zip(said, hints, strict=True))
