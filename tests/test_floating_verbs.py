"""What verbs say of the shipped robots that nothing holds: a body in a hand, an arm on a cart."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identifiability import Robot, analyze, compare, diagnose, export, payload
from identifiability.robot.locate import shipped_folder

STUDY = Path(__file__).resolve().parents[1] / "studies/shipped/floating_bases.py"
DRIVE = ["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia"]


@pytest.fixture(scope="module")
def made():
    """The study that makes logs of robots that float."""
    spec = importlib.util.spec_from_file_location("floating_bases", STUDY)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def log(robot, name):
    return pd.read_csv(shipped_folder() / robot / "logs" / name)


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    """The arm on its cart, analysed while a hand pushes it, and the file of that."""
    found = analyze("cart-arm", log("cart-arm", "pushed.csv"), replicates=50)
    return found, found.to_json(tmp_path_factory.mktemp("cart") / "result.json")


def test_an_arm_on_a_cart_that_is_pushed_says_what_it_says_bolted_down(pushed, tmp_path, rejected):
    page = pushed[0].write_report(tmp_path / "page.html").read_text()
    assert 'text">base.x<' not in page  # no motor drives it
    stands = Robot.load("cart-arm", base="fixed")
    held = analyze(stands, log("cart-arm", "bolted.csv"), replicates=50)
    with rejected(r"no mass of cart: its robot was held"):
        export("cart-arm", held, tmp_path / "cart.xml")
    bolted = held.to_frame()
    moved = pushed[0].to_frame()
    for told in (bolted, moved):
        called = told[told["verdict"] == "identifiable"]
        low, high = np.array(called[["lower", "upper"]]).T
        inside = (low <= called["nominal"]) & (called["nominal"] <= high)
        assert inside.mean() > 0.8
        assert len(called) >= 15
    both = bolted.merge(moved, on="name", suffixes=("", "_moved"))
    same = both[np.isclose(both["nominal"], both["nominal_moved"])]  # else they stand for others
    assert (same["verdict"] == same["verdict_moved"]).mean() > 0.85
    assert len(same) >= 15


def test_what_is_little_but_noise_of_the_sensor_on_a_base_is_not_known_wrongly(made):
    told = analyze("cart-arm", made.cart_arm(2, pushed=True), replicates=50)
    low, high = told.to_frame(details=True).set_index("name").loc["yaw.Ia"]["interval95"]
    assert low <= told.robot.nominal["yaw.Ia"] <= high


def test_a_load_on_a_cart_that_is_pushed_is_weighed(pushed, made):
    loaded = made.cart_arm(2, pushed=True, load=0.4)
    found = payload("cart-arm", pushed[1], loaded)
    assert found.body == "lower"
    assert found.mass.value == pytest.approx(0.4, rel=0.03)


def test_predictions_hold_and_what_changed_or_is_missing_is_named_on_a_moving_base(pushed, made):
    other = made.cart_arm(1, pushed=True)
    assert pushed[0].predict(other).error_ra < 0.02
    rubs = made.cart_arm(3, pushed=True, rubs=0.6)
    assert "riction of shoulder rose" in compare("cart-arm", other, rubs).details
    model = [*DRIVE[:2], DRIVE[3], "coulomb_friction@yaw+elbow"]
    assert "Coulomb friction in shoulder" in diagnose("cart-arm", rubs, model=model).details
    assert not diagnose("free-body", log("free-body", "run1.csv"), quick=True).effects  # no joints


@pytest.mark.parametrize(
    "joints, factor, words",
    [
        (["shoulder", "shoulder"], -1.0, "shoulder seems to have the wrong sign"),
        (["elbow", "elbow"], 1e3, "elbow is"),
        (["yaw", "shoulder"], 1.0, "yaw and shoulder seem to be exchanged"),
    ],
)
def test_torque_columns_of_an_arm_on_a_moving_base_are_read_right(joints, factor, words, pushed):
    frame = log("cart-arm", "pushed.csv")
    columns = [f"{joint}.tau" for joint in dict.fromkeys(joints)]
    frame[columns] = factor * frame[columns[::-1]].to_numpy()
    found = analyze("cart-arm", frame, quick=True)
    assert words in found.alternative.description
    assert found.chosen.error_ra_validation <= 1.05 * pushed[0].chosen.error_ra_validation
    assert pushed[0].alternative is None


def test_reversed_positions_on_a_moving_base_are_not_read_as_another_fault():
    frame = log("cart-arm", "pushed.csv")
    frame["shoulder.q"] *= -1.0
    assert analyze("cart-arm", frame, quick=True).alternative is None
