"""Names come from files: spaces, accents, markup and tags pass through and do no harm."""

import json

from identifiability import Robot, simulate
from identifiability.robot.locate import locate_robot
from identifiability.simulation import random_trajectory


def test_spaces_accents_and_tags_pass_through_and_no_tag_is_run(tmp_path, command, rng):
    folder = tmp_path / "ein Ordner & mehr"
    folder.mkdir()
    path, out, report = (folder / name for name in ("röbot 1.xml", "out.json", "<b>.html"))
    text = locate_robot("two-link").read_text()
    text = text.replace('"elbow"', '"&lt;script>alert(1)&lt;/script> ü"')
    path.write_text(text)
    robot = Robot.load(path)
    log = simulate(robot, random_trajectory(robot, rng, samples=100)).write(folder / "lög 1.csv")
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
    assert "If one of wrist\\x1b[2J\\u200b is it, add --map" in sentence
    sentence = refuses("two-link", arm.rename(columns=lambda c: c.replace("elbow", "e" * 900)))
    assert "one of " + "e" * 100 + "…" + "e" * 60 + " is it" in sentence
    assert len(sentence) < 600
    sentence = refuses("two-link", arm.rename(columns=lambda c: c.replace("elbow", "e" * 5000)))
    assert "has a column whose name has 5004 letters" in sentence
    assert len(sentence) < 300
