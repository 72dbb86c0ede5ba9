"""Results of every verb are exported, or refused with one sentence that can be followed."""

import json

import pytest

from identifiability import Noise, Robot, analyze, diagnose, export

from ..conftest import shipped_log
from .conftest import replay

QUIET = Noise(torque=0.02)


def make_log(name, trajectory, hide, seed=0):
    return shipped_log(Robot.load(name), trajectory, 400, noise=QUIET, hide=hide, seed=seed)


@pytest.mark.parametrize("fixed", [False, True])
def test_a_diagnosis_is_exported_with_what_it_named(fixed, tmp_path):
    hide = ["stribeck_friction@elbow=0.3"]
    logs = [make_log("two-link", trajectory, hide, k) for k, trajectory in enumerate("ab")]
    found = diagnose(
        "two-link", logs[0], logs[1], effects=["stribeck_friction"], fixed=fixed, quick=True,
        forward=False,
    )  # fmt: skip
    assert "elbow" in found.effects[0].joints
    again = replay(found.robot, found, found.samples[0], tmp_path)
    assert again.stated["error_ra"] < 0.9 * again.stated["error_ra_file"]
    assert again.mujoco == pytest.approx(again.stated["error_ra_file"], rel=1e-4)
    assert again.whole == pytest.approx(again.stated["error_ra"], rel=1e-4)
    assert again.robot.shapes["elbow.stribeck_friction"] > 0


def test_a_body_that_cannot_exist_is_refused(tmp_path, rejected):
    result = analyze("two-link", make_log("two-link", "a", []), replicates=0)
    path = result.to_json(tmp_path / "result.json")
    content = json.loads(path.read_text())
    content["physical"]["parameters"]["link2.Ixx"] = 99.0
    path.write_text(json.dumps(content))
    with rejected(r"link2: .*no body turns like that"):
        export(result.robot, path, tmp_path / "x.xml")
    assert not (tmp_path / "x.xml").exists()
    large = r"link1.my': input should be less than or equal to 10{15}"
    wrong = (("link1.my", 1e300, large), ("link2.m", 1e-320, "no mass of link2"))
    for name, value, why in wrong:
        content["physical"]["parameters"] |= {"link2.Ixx": 0.1, name: value}
        path.write_text(json.dumps(content))
        with rejected(why):
            export(result.robot, path, tmp_path / "x.xml")
        del content["physical"]["parameters"][name]
