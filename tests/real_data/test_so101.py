"""SO-101, real logs of a hobby arm: it lay on its table in two of them."""

import numpy as np

from identifiability import Log, Robot
from identifiability.logs.conventions import Conventions
from identifiability.servos.contacts import find_blocked
from identifiability.simulation.rollout import CommandedRobot

LAY = ("shoulder_lift", "elbow_flex", "wrist_flex")


def test_joints_that_the_table_holds_are_found_and_no_others(tmp_path, data):
    folder = data("so101")
    path = tmp_path / "so101.urdf"
    path.write_bytes((folder / "so101.urdf").read_bytes())
    path.with_suffix(".toml").write_text("[servo]\nkp = 17.8\nkv = 0.6\n")
    arm = Robot.load(path)
    held = {}
    for name in ("chirp_sweep", "multisine", "large_amplitude", "workspace_sweep"):
        log = Log.read(folder / f"{name}.csv", Conventions.of(arm)).select(arm.joints)
        rows = find_blocked(CommandedRobot(arm, {}), log)
        held |= {(name, arm.joints[j]): log.t[rows[:, j]] for j in np.flatnonzero(rows.any(0))}
    lay = {("large_amplitude", joint) for joint in LAY}
    assert {*held} == {("workspace_sweep", "elbow_flex"), *lay}
    assert all(np.all(abs(held[key] - 106.0) < 5.0) for key in lay)
