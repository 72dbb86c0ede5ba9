"""What a robot of many joints costs: each actuator's rows, over the columns that it can see."""

import numpy as np
import pandas as pd
import pytest

from identifiability import (
    Log,
    Model,
    Regression,
    Robot,
    estimate,
    find_base_parameters,
    gather_information,
    prepare_log,
)  # fmt: skip
from identifiability.estimation.fit import bootstrap

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
SAMPLES = 2000


def tree_text(joints: int, seed: int = 0) -> str:
    """Return the MJCF of a tree whose links hang on links drawn at random, or on the ground."""
    rng = np.random.default_rng(seed)
    children: dict[int, list[int]] = {k: [] for k in range(-1, joints)}
    for k in range(joints):
        children[int(rng.integers(-1, k))].append(k)

    def body(k: int) -> str:
        x, y, z = rng.uniform(-0.2, 0.2, 3)
        axis = ("1 0 0", "0 1 0", "0 0 1")[k % 3]
        inner = "".join(body(c) for c in children[k])
        return (
            f'<body name="b{k}" pos="{x:.3f} {y:.3f} .25"><inertial pos="{x / 3:.3f} .02 '
            f'{z / 3:.3f}" mass="1.5" diaginertia=".02 .018 .015"/><joint name="j{k}" '
            f'axis="{axis}" damping=".3" frictionloss=".2" armature=".01"/>{inner}</body>'
        )

    bodies = "".join(body(c) for c in children[-1])
    motors = "".join(f'<motor name="a{k}" joint="j{k}"/>' for k in range(joints))
    return (
        f'<mujoco model="tree{joints}"><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
        f"<actuator>{motors}</actuator></mujoco>"
    )


def regression_of(joints, folder):
    path = folder / "tree.xml"
    path.write_text(tree_text(joints))
    robot, model = Robot.load(path), Model.of(*EFFECTS)
    rng = np.random.default_rng(1)
    t = np.arange(SAMPLES) / 100
    frequency, phase = 0.1 * rng.integers(1, 20, (joints, 5)), rng.uniform(0, 6, (joints, 5))
    q = 0.2 * np.sin(2 * np.pi * frequency * t[:, None, None] + phase).sum(2)
    data = {"t": t} | {f"{j}.q": x for j, x in zip(robot.joints, q.T, strict=True)}
    data |= {f"{j}.tau": rng.normal(size=SAMPLES) for j in robot.joints}
    pd.DataFrame(data).to_csv(folder / "log.csv", index=False)
    samples = prepare_log(robot, Log.read(folder / "log.csv"))
    return Regression(robot, model, (samples,), find_base_parameters(robot, model).kept)


@pytest.mark.parametrize("joints", [24])
def test_a_tree_of_many_joints_is_held_in_its_own_rows(joints, tmp_path):
    information = gather_information(regression_of(joints, tmp_path))
    # A column of a link acts on the joints that carry it; the rest of a row is not held.
    widths = [len(part.columns) + 1 for part in information.parts]
    assert sum(widths) < 0.3 * joints * (information.size + 1)
    blocks, samples = len(information.counts), int(information.counts.max())
    rows = sum(blocks * min(samples, w) * w + w * w for w in widths)
    held = sum(part.blocks.nbytes for part in information.parts)
    assert held <= 8 * rows
    assert held <= 10e6  # dense Gram blocks: 2 GB
    fit = estimate(information)
    found = bootstrap(information, fit, np.random.default_rng(0), replicates=100)
    spread = np.median(found.sd[fit.determined] / fit.sigma[fit.determined])
    assert 0.7 < spread < 1.3  # white noise: both are right
