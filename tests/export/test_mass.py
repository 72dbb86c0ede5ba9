"""A real robot far heavier than the file's is told of first, with a remedy that works."""

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import Robot, analyze, prune
from identifiability.cli import app
from identifiability.physical.mass import state_mass, total_mass
from identifiability.regression.reduction import LadderEntry, RungEntry

FULL = LadderEntry(models=[RungEntry(name="full")])


@pytest.fixture(scope="module")
def log(simulated_session):
    return simulated_session("3-rps", "601", 0)


def test_a_heavy_robot_is_told_of_and_the_remedy_works(log, tmp_path):
    result = analyze("3-rps", log, ladder=FULL, replicates=50)
    mass = total_mass(result.robot, result.chosen.physical.parameters())
    assert mass > 3 * 25.248
    path = result.to_json(tmp_path / "result.json")
    run = CliRunner().invoke(app, ["export", "3-rps", str(path), "--out", str(tmp_path / "x.xml")])
    first = run.output.splitlines()[0]
    assert first.startswith(f"The nearest real robot weighs {mass:.4g} kg, that of the robot file ")
    assert first.endswith("analyze and prune with --cad-prior 1 keep it near the file.")
    assert first in result.statement
    assert first in result.physical_statement
    light = analyze("3-rps", log, ladder=FULL, replicates=50, cad_weight=1.0)
    assert "weighs" not in light.statement
    assert total_mass(light.robot, light.chosen.physical.parameters()) < 3 * 25.248


def test_pruning_knows_the_remedy(log):
    entry = LadderEntry(models=[RungEntry(name="few", keep=["platform.mx", "slider1.Fv"])])
    heavy = prune("3-rps", log, ladder=entry, replicates=2, cad_weight=1.0)
    assert "weighs" not in heavy.statement
    assert heavy.to_dict()["physical"]["cad_prior"] == 1.0


def test_three_times_the_file_is_the_limit():
    robot = Robot.load("two-link")  # 6.5 kg, of bodies with volume
    values = dict(robot.nominal)
    assert not state_mass(robot, values)
    assert not state_mass(robot, values | {"link1.m": 4.0 + 12.99})
    assert "weighs 19.51 kg" in state_mass(robot, values | {"link1.m": 4.0 + 13.01})
    assert "--cad-prior 20" in state_mass(robot, values | {"link1.m": 40.0}, 2.0)


def test_the_remedy_says_what_stands_in_its_way(tmp_path):
    shipped = Robot.load("six-dof-arm")
    wrong = tmp_path / "wrong.urdf"
    wrong.write_text(shipped.path.read_text().replace('izz="0.286"', 'izz="9.9"'))
    advice = state_mass(Robot.load(wrong, shipped.sidecar), {"link_1.m": 1000.0})
    assert "correct the bodies of the robot file that cannot exist; then" in advice
    robot = Robot.load("two-link")
    carried = dict(robot.nominal) | {"link2.payload_m": 100.0}
    assert "leave the effect payload out" in state_mass(robot, carried)
    assert np.isclose(total_mass(robot, carried), 106.5)
