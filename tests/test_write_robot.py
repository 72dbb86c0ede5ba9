"""A robot file written with other parameters gives these parameters on both roads."""

from identifiability import Robot
from identifiability.workflows.export import write_parameters


def test_only_the_numbers_that_changed_are_written_anew(rps, tmp_path):
    """Comments, order and indentation of the user's file stay: one tag differs."""
    name = rps.path.name
    own = rps.path.read_text().splitlines()
    changed = {"leg1_lower.Izz": 0.99 * rps.nominal["leg1_lower.Izz"]}
    rps.with_values(changed).save(tmp_path / name)
    assert rps.path.read_text().splitlines() == own
    new = (tmp_path / name).read_text().splitlines()
    assert len(new) == len(own)
    differ = [k for k, lines in enumerate(zip(own, new, strict=True)) if lines[0] != lines[1]]
    assert 1 <= len(differ) <= 2
    assert all("<inertial" in new[k] for k in differ)


def test_a_body_without_mass_is_refused_by_name(rps, tmp_path, rejected):
    with rejected("'platform' has a mass of -1 kg"):
        write_parameters(rps, {"platform.m": -1.0}, tmp_path / "copy.xml")
    assert not (tmp_path / "copy.xml").exists()


def test_what_a_robot_file_cannot_hold_stands_in_the_sidecar_and_is_listed(rps, tmp_path):
    values = {"slider2.Fs": 4.0, "slider3.Fq": 0.01}
    shapes = {"slider2.stribeck_friction": 0.02}
    written = write_parameters(
        rps, values, tmp_path / "copy.xml", shapes=shapes, reference={"platform.m": 7.0}
    )
    assert set(written.beside) == set(values)
    copy = Robot.load(tmp_path / "copy.xml")
    assert {name: copy.nominal[name] for name in values} == values
    assert copy.shapes == shapes
    assert copy.reference == {"platform.m": 7.0}
    again = write_parameters(copy, {}, tmp_path / "again.xml", shapes={}, reference={})
    assert Robot.load(tmp_path / "again.xml").nominal["slider2.Fs"] == 4.0
    assert not Robot.load(tmp_path / "again.xml").shapes
    assert set(again.beside) == set(values)
