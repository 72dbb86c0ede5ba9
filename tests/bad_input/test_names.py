"""Names come from files: spaces, accents, markup and tags pass through and do no harm."""

import json

import numpy as np
import pytest

from identifiability.robot import Robot
from identifiability.robot.locate import locate_robot
from identifiability.simulation import random_trajectory, simulate


@pytest.fixture
def odd(tmp_path):
    """A function (name) -> robot file and log of a two-link arm whose second joint is called so."""

    def make(name: str):
        folder = tmp_path / "ein Ordner & mehr"
        folder.mkdir()
        escaped = name.replace("&", "&amp;").replace("<", "&lt;")
        path = folder / "röbot 1.xml"
        text = locate_robot("two-link").read_text().replace('"elbow"', f'"{escaped}"')
        path.write_text(text, encoding="utf-8")
        robot = Robot.load(path)
        motion = random_trajectory(robot, np.random.default_rng(0), samples=100)
        return path, simulate(robot, motion).write(folder / "lög 1.csv")

    return make


def test_spaces_accents_and_tags_pass_through_and_no_tag_is_run(odd, command):
    path, log = odd("<script>alert(1)</script> ü")
    out, report = log.with_name("out.json"), log.with_name("<b>.html")
    done = command("analyze", path, log, "--json", out, "--report", report, "--quick")
    assert done.exit_code == 0, done.output
    names = [p["name"] for p in json.loads(out.read_text())["full_parameters"]]
    assert "<script>alert(1)</script> ü.Fv" in names
    text = report.read_text()
    assert "<script>alert" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; ü" in text


def test_an_error_quotes_odd_names_on_one_short_line(refuses, arm):
    odd = "wrist\x1b[2J\u200b"
    sentence = refuses("two-link", arm.rename(columns=lambda c: c.replace("elbow", odd)))
    assert "for wrist\\x1b[2J\\u200b, which the robot does not have" in sentence
    sentence = refuses("two-link", arm.rename(columns=lambda c: c.replace("elbow", "e" * 5000)))
    assert "for " + "e" * 100 + "…" + "e" * 59 + ", which the robot" in sentence
    assert len(sentence) < 600
