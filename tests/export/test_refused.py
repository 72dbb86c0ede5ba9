"""A file that errs more than the one that it comes from is written only by force."""

import json
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, export, simulate
from identifiability.simulation.motion import find_motion
from identifiability.workflows.export.workflow import save_robot


@pytest.fixture
def runs(tmp_path, two_link):
    """A function that returns a robot, and a log of it for each mass of a load [kg]."""

    def simulate_runs(*loads):
        rng = np.random.default_rng(7)
        logs = []
        for load in loads:
            values = {"link2.m": two_link.nominal["link2.m"] + load}
            machine = Robot.load(save_robot(two_link, values, tmp_path / f"machine{load}.xml"))
            motion = find_motion(machine, "random", 400, rng)
            log = simulate(machine, motion, noise=Noise(torque=0.01), rng=rng)
            logs.append(replace(log, name=f"run{len(logs)}"))
        return two_link, *logs

    return simulate_runs


def test_a_file_that_errs_more_on_motion_that_was_not_fitted_is_refused(runs, tmp_path, rejected):
    robot, loaded, bare = runs(4.0, 0.0)
    result = analyze(robot, loaded, bare, replicates=0)
    stated = result.real_robot
    given = stated["error_ra_validation_given_files"]["mjcf"]
    assert stated["error_ra_validation_files"]["mjcf"] > 1.5 * given
    with rejected(r"fit\.xml alone errs by .* force=True"):
        export(robot, result, tmp_path / "fit.xml")
    assert not (tmp_path / "fit.xml").exists()
    forced = export(robot, result, tmp_path / "fit.xml", validate=bare, force=True)
    assert f"{robot.path.name} by {100 * given:.3g} %" in forced.statement
    # The file, read again, errs as was said of it.
    assert forced.unseen.before == pytest.approx(given, rel=0.01)


def test_a_file_that_errs_more_on_the_fitted_logs_is_refused(runs, tmp_path, rejected):
    robot, log, unseen = runs(4.0, 4.0)
    result = analyze(robot, log, unseen, replicates=0)
    stated = result.real_robot
    assert stated["error_ra_files"]["mjcf"] < stated["error_ra_given_files"]["mjcf"]
    path = result.to_json(tmp_path / "result.json")
    export(robot, path, tmp_path / "sound.xml")
    content = json.loads(path.read_text())
    content["physical"]["error_ra_given_files"]["mjcf"] = 0.9 * stated["error_ra_files"]["mjcf"]
    content["physical"]["parameters"]["elbow.Fs"] = 1.0
    content["parameters"].append({"name": "elbow.Fs", "torque_share": 0.5})
    path.write_text(json.dumps(content), "utf-8")
    why = (
        r"On the fitted logs refused\.xml alone errs .* cannot hold Stribeck friction \(elbow\.Fs\)"
    )
    with rejected(why):
        export(robot, path, tmp_path / "refused.xml")
