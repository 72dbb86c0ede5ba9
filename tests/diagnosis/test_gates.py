"""Gates: real robots, changed preparations, and what a log's noise is."""

import importlib
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose import Rules, Setting, gather
from identifiability.workflows.diagnose.gates import (
    CLOCK,
    Naming,
    Step,
    Survival,
    add_places,
    keep_possible,
    keep_surviving,
    list_units,
)
from identifiability.workflows.diagnose.motion import prepare_rows
from identifiability.workflows.diagnose.stress import blur_motion, shift_torque, white_noise
from identifiability.workflows.diagnose.workflow import BASE_EFFECTS

STUDIES = Path(__file__).resolve().parents[2] / "studies"


@pytest.fixture(scope="module")
def material(logs_of):
    robot = Robot.load("two-link")
    logs = logs_of("two-link", "gravity_tilt=0.02")
    samples = tuple(prepare_rows(robot, log, None) for log in logs)
    structure = Structure.of(robot, Model.of(*BASE_EFFECTS))
    setting = Setting(structure, samples[:4], samples[4:])
    return gather(setting, (), np.random.default_rng(0), draws=2)


def pick(material, family, place=None):
    return [c for c in material.candidates if c.family.name == family and place in (None, c.place)]


def test_a_real_robots_fit_is_feasible_and_fits_worse_than_least_squares(material):
    spring = pick(material, "joint_stiffness")
    value, free = (material.held.fit(spring, real=real) for real in (True, False))
    W = material.train.columns(spring)
    left, least = (np.sum((material.train.tau - W @ v) ** 2, axis=0) for v in (value, free))
    weight = 1 / np.mean((material.train.tau - W @ free) ** 2, axis=0)
    assert left @ weight >= least @ weight * (1 - 1e-6)
    assert (value[material.train.X.shape[2] :] >= -1e-6 * np.abs(value).max()).all()


def test_where_least_squares_is_a_real_robot_both_agree(material):
    """Law: constrained = unconstrained where nothing is active."""
    structure = material.setting.structure
    values = np.maximum(structure.nominal, np.where(structure.nonnegative, 1e-3, -np.inf))
    tau = material.train.X @ (structure.G @ values)
    noise = 1e-6 * np.sqrt(np.mean(tau**2)) * np.random.default_rng(0).standard_normal(tau.shape)
    rows = replace(material.train, tau=tau + noise)
    held = replace(material.held, train=rows)
    found, free = (rows.X @ held.fit((), real=real) for real in (True, False))
    assert not np.array_equal(found, free)  # the solver did find one
    np.testing.assert_allclose(found, free, atol=1e-5 * np.abs(tau).max())


@dataclass
class Told:
    """Held-out errors that are told: each family takes its share, as a real robot another one."""

    shares: dict[str, tuple[float, float]]
    real: object = object()

    def gain(self, rest, whole, *, real=False):
        from identifiability.workflows.diagnose.held_out import Gain

        lost = {c.family.name for c in whole} - {c.family.name for c in rest}
        return Gain(sum(self.shares[n][real] for n in lost), 0.01)


def test_a_special_name_goes_when_its_gain_vanishes_in_a_real_robot(material):
    chosen = [
        *pick(material, "joint_stiffness", "elbow"),
        *pick(material, "torque_offset", "elbow"),
    ]
    held = Told({"joint_stiffness": (0.3, -0.02), "torque_offset": (0.2, -0.1)})
    kept = keep_possible(held, chosen, material.candidates, Rules())
    # Offsets are what every joint may have: they are not refused.
    assert [c.family.name for c in kept] == ["torque_offset"]
    held = Told({"joint_stiffness": (0.3, 0.02), "torque_offset": (0.2, -0.1)})
    assert keep_possible(held, chosen, material.candidates, Rules()) == chosen
    held = Told({"joint_stiffness": (0.3, 0.009), "torque_offset": (0.2, -0.1)})
    assert len(keep_possible(held, chosen, material.candidates, Rules())) == 1  # within one error


def test_special_names_are_judged_beside_what_every_joint_has(material):
    some = pick(material, "torque_offset", "elbow")
    assert {c.place for c in add_places(some, material.candidates)} == {"shoulder", "elbow"}
    assert [len(u) for u in list_units(pick(material, "joint_stiffness"))][-1] == 2


def test_a_shifted_clock_warns_and_another_preparation_refutes(material):
    chosen = tuple(pick(material, "joint_stiffness"))
    present = material.setting.structure.present
    step = Step({}, 1.0, chosen[0].group, 0.005, 0.1, True, "named")
    naming = Naming(chosen, {}, (step,))
    assert not Survival(CLOCK[0], 0.0, False).refutes
    assert Survival("filter 20 % lower", 0.0, True).refutes
    why = "another preparation of the motion refutes it"
    left = keep_surviving(naming, chosen[:1], present, why)
    assert left.chosen == chosen[1:]
    gone = keep_surviving(naming, chosen, present, why)
    assert gone.chosen == ()
    assert not gone.steps[0].accepted
    assert gone.steps[0].reason == why


def test_a_refinement_goes_with_what_it_refines(material):
    """Without the base model's Coulomb friction, Stribeck needs the one that was named."""
    present = material.setting.structure.present
    bump = pick(material, "stribeck_friction", "elbow")[:1]
    naming = Naming(tuple(bump), {}, ())
    assert keep_surviving(naming, (), present, "").chosen == tuple(bump)
    assert keep_surviving(naming, (), (), "").chosen == ()


def test_a_shifted_torque_is_the_torque_of_another_sample():
    tau = np.arange(5.0)[:, None]
    assert shift_torque(tau, 1).ravel().tolist() == [1, 2, 3, 4, 4]
    assert shift_torque(tau, -1).ravel().tolist() == [0, 0, 1, 2, 3]


def test_white_noise_of_the_motion_is_seen_beside_the_motion_and_doubled(logs_of):
    rng = np.random.default_rng(0)
    t = np.arange(4000) / 100
    clean = np.sin(2 * np.pi * t)[:, None]
    noisy = clean + 1e-4 * rng.standard_normal(clean.shape)
    # The median of some thousand correlated differences; 10 % is five of its standard errors.
    assert white_noise(noisy)[0] == pytest.approx(1e-4, rel=0.1)
    assert white_noise(clean)[0] < 1e-6
    log = replace(logs_of("two-link")[0], q=np.column_stack([noisy, noisy])[:750])
    twice = blur_motion(log, rng)
    assert np.std(twice.q - log.q) == pytest.approx(1e-4, rel=0.15)


@pytest.fixture
def study():
    sys.path.insert(0, str(STUDIES))
    yield importlib.import_module("hidden_effect")
    sys.path.remove(str(STUDIES))


def test_the_study_goes_on_where_it_was_stopped(study, tmp_path, monkeypatch):
    jobs = list(study.list_jobs(1, 1, ["five-bar"], ["null", "single"]))[:7]
    path = tmp_path / "hidden_effect.jsonl"
    asked = []

    def told(job):
        asked.append(job.key)
        return {"key": job.key, "outcome": "no name", "named": "", "study": job.study}

    monkeypatch.setattr(study, "_row", told)
    study.run_rest(jobs[:3], path, 1)
    with path.open("a") as file:
        file.write('{"key": "cut o')
    frame = study.run_rest(jobs, path, 1)
    assert asked == [j.key for j in jobs]
    assert frame.key.tolist() == [j.key for j in jobs]
    assert len(path.read_text().splitlines()) == 7
