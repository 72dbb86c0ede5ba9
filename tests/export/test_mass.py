"""A real robot weighs about what its file says; a far heavier one is told of, with a remedy."""

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, export, simulate
from identifiability.physical.cad_prior import state_mass, total_mass
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.simulation.motion import find_motion
from identifiability.workflows.export.joints import describe_joints

FULL = LadderEntry(models=[ModelEntry(name="full")])


def test_a_robot_of_which_the_logs_say_little_weighs_as_its_file_says(noisy_log):
    result = analyze("3-rps", noisy_log, ladder=FULL, replicates=50)
    found = result.chosen.physical.parameters()
    assert 25.248 / 3 < total_mass(result.robot, found) < 3 * 25.248
    assert "weighs" not in result.details
    rows = result.to_dict()["physical"]["masses"]
    masses = [found[f"{b}.m"] for b in result.robot.bodies]
    assert [row["mass"] for row in rows] == pytest.approx(masses, rel=1e-5)
    assert sum(row["mass_file"] for row in rows) == pytest.approx(25.248, rel=1e-3)


def test_without_the_prior_a_heavy_robot_is_told_of_and_the_remedy_works(
    noisy_log, command, tmp_path
):
    result = analyze("3-rps", noisy_log, ladder=FULL, replicates=50, cad_prior=0.0)
    mass = total_mass(result.robot, result.chosen.physical.parameters())
    assert mass > 3 * 25.248
    path = result.to_json(tmp_path / "result.json")
    run = command("export", "3-rps", path, "--out", tmp_path / "x.xml", "--force")
    first = run.output.splitlines()[0]
    assert first.startswith(f"The nearest physically consistent robot weighs {mass:.4g} kg, that")
    assert first.endswith("--set cad_prior=1 keeps it nearer to the file's proportions.")
    assert first.partition(":")[0] in result.details
    assert "not determined" not in run.output
    light = analyze("3-rps", noisy_log, ladder=FULL, replicates=50, cad_prior=1.0)
    assert total_mass(light.robot, light.chosen.physical.parameters()) < 3 * 25.248


def test_three_times_the_file_is_the_limit_and_a_third_of_it(two_link):
    values = two_link.nominal  # 6.5 kg, of bodies with volume
    assert "file 6.5 kg (link1 12.1 kg, by" in state_mass(two_link, values | {"link1.m": 12.1})
    heavy = values | {"link1.m": 40.0}
    assert "--set cad_prior=20" in state_mass(two_link, heavy, 2.0)
    lacking = state_mass(two_link, heavy, missing="the model lacks a spring")
    assert "lacks a spring, and the nearest physically consistent robot weighs 42.5 kg" in lacking
    far = describe_joints(two_link, [{"label": "", "verdict": ""}], heavy)
    assert "sums: link1.m 40 (file: 4). Do" in far[-1]
    row = {"label": "Iyy(link2) + Ia(elbow)", "verdict": "identifiable", "nominal": 0.12}
    row["interval95"] = 0.178, 0.182  # of the file: 0.02 of the rotor, 0.1 of the body
    for rotor, said in ((0.08, "between 0.078 and 0.082, if bodies"), (0.1, "Do not train")):
        found = values | {"elbow.Ia": rotor}
        assert said in describe_joints(two_link, [row], found, share=2e-3)[-1]
    arm = Robot.load("hobby-arm")  # no body weighs a third of it
    for share in (1 / 3.01, 1 / 2.99, 2.99, 3.01):
        told = state_mass(arm, {name: share * x for name, x in arm.nominal.items()})
        assert bool(told) != (1 / 3 < share < 3)
    assert not state_mass(two_link, {"elbow.Fv": 1.0})


AXES = """<mujoco><worldbody><body name="cart"><joint name="x" type="slide" axis="1 0 0"
armature="5"/><inertial mass="20" pos="0 0 0" diaginertia="1 1 1"/><body name="head"><joint name="b"
axis="0 1 0" armature=".05"/><inertial mass="{0}" pos="0 0 -.1" diaginertia=".01 .01 .01"/></body>
</body></worldbody></mujoco>"""


def test_a_rotor_whose_sum_with_masses_alone_is_determined_stays_near_the_file(tmp_path):
    file, true = (tmp_path / name for name in ("file.xml", "true.xml"))
    file.write_text(AXES.format(1))
    true.write_text(AXES.format(5))  # a tool that the file lacks
    rng = np.random.default_rng(1)
    robot = Robot.load(true)
    log = simulate(robot, find_motion(robot, "random", 1500, rng), noise=Noise(torque=0.02))
    result = analyze(file, log, "none", replicates=0)
    written = export(file, result, tmp_path / "fitted.xml").robot
    assert 4.0 < Robot.load(written).nominal["x.Ia"] < 6.0
