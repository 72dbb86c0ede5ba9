"""A joint that sticks at every reversal is no fault of the log: clean logs are called clean."""

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, analyze
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.logs.rules import RULES as LOG_RULES

from ..conftest import write_robot

LINK = """<mujoco model="pendulum"><compiler angle="radian"/><worldbody><body name="link">
<joint name="hinge" axis="0 1 0" range="-3 3" armature=".2"/>
<inertial mass="2" pos=".3 0 .02" diaginertia=".02 .03 .02"/></body></worldbody>
<actuator><motor joint="hinge"/></actuator></mujoco>"""

INERTIA, MX, MZ, VISCOUS, DRY = 0.2 + 0.03 + 2 * (0.3**2 + 0.02**2), 0.6, 0.04, 0.4, 1.5

STEP, EVERY, ENCODER = 1e-3, 10, 2 * np.pi / 2**17


def sticking_log(seed):
    """Return a log at 100 Hz of a link under a controller: dry friction holds what it can."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 11.0, STEP)
    waves = np.sin(2 * np.pi * np.array([0.2, 0.35, 0.5]) * t[:, None] + rng.uniform(0, 6.28, 3))
    wanted = waves @ rng.uniform(0.2, 0.5, 3)
    speed = np.gradient(wanted, STEP)
    q = wanted[0]
    v = 0.0
    rows = np.empty((len(t), 2))
    for k in range(len(t)):
        tau = 400 * (wanted[k] - q) + 25 * (speed[k] - v)
        rows[k] = q, tau
        push = tau + 9.81 * (MX * np.cos(q) + MZ * np.sin(q)) - VISCOUS * v
        way = np.sign(v) or np.sign(push)
        ahead = v + STEP * (push - way * DRY) / INERTIA
        v = ahead if way * ahead > 0 else 0.0  # it stops before it turns
        q += STEP * v
    q, tau = rows[round(1 / STEP) :: EVERY].T
    tau = tau + 0.01 * tau.std() * rng.standard_normal(len(tau))
    t = EVERY * STEP * np.arange(len(q))
    q = ENCODER * np.rint(q / ENCODER)
    return Log.from_frame(pd.DataFrame({"t": t, "hinge.q": q, "hinge.tau": tau}), f"log{seed}")


@pytest.fixture(scope="module")
def link(tmp_path_factory):
    return write_robot(tmp_path_factory.mktemp("link"), LINK)


def test_friction_that_sticks_is_no_error_of_clocks_and_values_hold(link):
    logs = [sticking_log(seed) for seed in (1, 2, 3)]
    found = analyze(link, logs, replicates=50)
    assert not any("apart in time" in h or "farther from the model" in h for h in found.hints)
    truth = {"link.Iyy": INERTIA, "link.mx": MX, "link.mz": MZ, "hinge.Fv": VISCOUS}
    for verdict in found.chosen.verdicts:
        true = {**truth, "hinge.Fc": DRY}[verdict.name]
        assert abs(verdict.value - true) <= 3 * verdict.sigma_robust


def test_the_motion_of_a_quiet_log_passes_whole_where_torque_is_kept(link):
    log = sticking_log(4)
    how = choose_cutoff(link, [log], None)
    assert how.outputs <= 0.5 * how.cutoff
    assert how.cutoff <= LOG_RULES.cutoff_highest * 100.0 * (1 + 1e-9)
