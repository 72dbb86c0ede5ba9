"""Are the two published arms of the da Vinci Research Kit identified back, spring and cable too?

Both robots come from their DH tables (models/dvrk-mtm, models/dvrk-psm). Logs along three motions
are simulated with friction, rotors, springs and the cable, with autocorrelated torque noise and
encoders; a fourth motion is held out. The master arm's cable is given, left out, or learned.

    python studies/dvrk.py [--quick]
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from identifiability.foundation.documents import toml_text
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.regression.reduction import LadderEntry, ModelEntry, ladder_path, read_ladder
from identifiability.regression.regression import Model
from identifiability.regression.structure import BaseParameters, find_base_parameters
from identifiability.report import (
    Check,
    Picture,
    Prose,
    Section,
    canvas,
    drawn,
    frame_table,
    write_page,
)
from identifiability.report.drawing import BLUE, GREY, INK, label_axes, legend_above
from identifiability.robot import Robot, complete_motion
from identifiability.simulation import Campaign, Noise, shipped_trajectory
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.diagnose import diagnose

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

ARMS = ("dvrk-mtm", "dvrk-psm")
#: Base parameters of the rigid bodies and of the whole model [Wang 2019].
PUBLISHED = {"dvrk-mtm": (46, 73), "dvrk-psm": (17, 49)}
SPRING = {"dvrk-mtm": "counter_spring.K", "dvrk-psm": "roll.K"}
CABLE, LEARNED = "m4", "position_torque@m4"
#: 5 % of the rms torque, correlated from sample to sample; encoders of 1e-5 rad or m.
NOISE = Noise(additive=0.05, correlation=0.9, encoder=1e-5)
FITTED, HELD_OUT = ("a", "b", "c"), ("d",)
#: What must hold: coverage, and the held-out error with a learned cable over the true one's.
LEAST, MOST = 0.93, 1.10

Say = Callable[[str, float], None]


@dataclass(frozen=True)
class Identified:
    """One arm over all seeds.

    Attributes
    ----------
    names : tuple of str
    truth : (b,)
    values, hits : (seeds, b)
        Fitted values, and whether their 95 % intervals hold the truth.
    identifiable, errors : (seeds,)
        Parameters with that verdict, and the error on the held-out motion.
    """

    names: tuple[str, ...]
    truth: np.ndarray
    values: np.ndarray
    hits: np.ndarray
    identifiable: np.ndarray
    errors: np.ndarray

    @property
    def coverage(self) -> float:
        """Share of all intervals that hold the truth."""
        return float(self.hits.mean())

    @property
    def spread(self) -> float:
        """Monte-Carlo error of the coverage: intervals of one seed err together."""
        shares = self.hits.mean(axis=1)
        return float(shares.std(ddof=1) / np.sqrt(len(shares)))


@dataclass(frozen=True)
class Cable:
    """The master arm with its cable given, left out and learned.

    Attributes
    ----------
    errors : (seeds, 3) [N·m]
        RMS error of the platform's torque on the held-out motion.
    positions, true : (N,)
        Of m4 [rad] and the cable's torque there less its mean [N·m].
    learned : (seeds, N)
        The same of what was learned: constants belong to the offsets.
    named : tuple of str
        What diagnose says where the cable is not given.
    """

    errors: np.ndarray
    positions: np.ndarray
    true: np.ndarray
    learned: np.ndarray
    named: tuple[str, ...]

    @property
    def ratio(self) -> np.ndarray:
        """Held-out error with the learned cable over that with the true one, (seeds,)."""
        return self.errors[:, 2] / self.errors[:, 0]

    @property
    def apart(self) -> float:
        """RMS difference between learned and true over that of the true one."""
        return float(np.sqrt(np.mean((self.learned - self.true) ** 2) / np.mean(self.true**2)))


@cache
def campaign(name: str) -> Campaign:
    """Return the motions of an arm with the torque of all that it has."""
    robot = Robot.load(name)
    return Campaign.of(robot, [shipped_trajectory(robot, x) for x in (*FITTED, *HELD_OUT)])


def published(robot: Robot) -> LadderEntry:
    """Return the ladder beside the robot: the published model alone."""
    path = ladder_path(robot)
    assert path is not None
    return read_ladder(path)


def simulate_logs(name: str, seed: int) -> tuple[list[Log], list[Log]]:
    """Return the logs to fit and those held out."""
    logs = campaign(name).logs(noise=NOISE, rng=np.random.default_rng(seed))
    return logs[: len(FITTED)], logs[len(FITTED) :]


def count(name: str) -> dict[str, Any]:
    """Return the numbers of base parameters beside the published ones."""
    robot = Robot.load(name)
    effects = published(robot).models[0].effects or []
    rigid = [text for text in effects if text.startswith("rigid_body")]
    few, all_ = (find_base_parameters(robot, Model.of(*e)) for e in (rigid, effects))

    def cell(found: BaseParameters, wanted: int) -> Check:
        return Check(str(found.rank), found.rank == wanted and not found.ambiguous, str(wanted))

    of_bodies, of_all = PUBLISHED[name]
    return {
        "arm": robot.title,
        "rigid body": cell(few, of_bodies),
        "with all effects": cell(all_, of_all),
        "gap of the rank": f"{all_.gap[0]:.1g} to {all_.gap[1]:.1g}",
    }


def identify(name: str, seeds: int, say: Say) -> Identified:
    """Simulate and identify an arm with every seed."""
    rows, truth, names = [], np.empty(0), ()
    for seed in range(seeds):
        say(f"identifying {name}", seed / seeds)
        fitted, unseen = simulate_logs(name, seed)
        result = analyze(campaign(name).robot, fitted, validate=unseen, seed=seed)
        frame, submodel = result.to_frame(), result.models[0].submodel
        truth = np.linalg.lstsq(
            submodel.M, result.structure.nominal_base - submodel.fixed, rcond=None
        )[0]
        low, high = np.array(frame["interval95"].tolist()).T
        names = tuple(frame["name"])
        error = float(result.ladder_frame()["error_ra_validation"].iloc[0])
        identifiable = int((frame["verdict"] == "identifiable").sum())
        hits = (low <= truth) & (truth <= high)
        rows.append((frame["value"].to_numpy(float), hits, identifiable, error))
    values, hits, identifiable, errors = map(np.array, zip(*rows, strict=True))
    return Identified(names, truth, values, hits, identifiable, errors)


def without_cable(robot: Robot, folder: Path) -> Robot:
    """Return the robot whose sidecar says nothing of the cable."""
    assert robot.sidecar is not None
    said, side = tomllib.loads(robot.sidecar.read_text(encoding="utf-8")), folder / "bare.toml"
    del said["known_torque"]
    side.write_text(toml_text(said), encoding="utf-8")
    return Robot.load(robot.path, sidecar=side)


def learn_cable(seeds: int, diagnosed: int, say: Say) -> Cable:
    """Fit the master arm with its cable given, left out and learned; diagnose it left out."""
    robot = campaign("dvrk-mtm").robot
    effects = published(robot).models[0].effects or []
    (axis,) = (a for a in robot.axes if a.name == CABLE)
    held = campaign("dvrk-mtm").move.q[campaign("dvrk-mtm").log == len(FITTED)]
    positions = np.linspace(*np.quantile(held @ axis.row, [0.02, 0.98]), 80)
    errors, learned, named = [], [], []
    with TemporaryDirectory() as folder:
        bare = without_cable(robot, Path(folder))
        for seed in range(seeds):
            say("learning the cable", seed / seeds)
            fitted, unseen = simulate_logs("dvrk-mtm", seed)
            results = [
                analyze(one, fitted, validate=unseen, ladder=_single(said), replicates=0)
                for one, said in ((robot, effects), (bare, effects), (bare, [*effects, LEARNED]))
            ]
            errors.append([_platform_error(result) for result in results])
            learned.append(_curve(results[-1], positions))
            if seed < diagnosed:
                found = diagnose(bare, fitted, unseen, model=effects, seed=seed, forward=False)
                said = (f"{e.name} in {' + '.join(e.joints)}" for e in found.effects)
                named.append("; ".join(said) or "nothing")
    true = robot.known_torque[0].force(positions)
    return Cable(np.array(errors), positions, true - true.mean(), np.array(learned), tuple(named))


def _single(effects: Sequence[str]) -> LadderEntry:
    return LadderEntry(models=[ModelEntry(name="model", effects=[*effects])])


def _platform_error(result: Analysis) -> float:
    frame = result.error_frame()
    return float(frame.loc[frame["name"] == "platform", "rms_validation"].iloc[0])


def _curve(result: Analysis, positions: np.ndarray) -> np.ndarray:
    """Return the learned torque at positions of m4, (N,), less its mean."""
    robot, splines = result.robot, Model.of(LEARNED)
    column = robot.joints.index("platform")  # m4 turns with it one to one
    home = robot.actuated_positions(robot.home[None])
    q = np.repeat(home, len(positions), 0)
    q[:, column] += positions - home[0, column]
    W = splines.regressor(robot, complete_motion(robot, positions, q, 0 * q, 0 * q))
    frame = result.to_frame()
    found = dict(zip(frame["name"], frame["value"], strict=True))
    values = [found.get(p.name, 0.0) for p in splines.parameters(robot)]
    force: np.ndarray = W[:, column] @ values
    return force - force.mean()


@drawn
def draw_cable(cable: Cable) -> Any:
    """Draw the cable's torque and what was learned of it."""
    figure, (axes,) = canvas(640, 300)
    for k, curve in enumerate(cable.learned):
        label = "learned, one line a log" if not k else None
        axes.plot(cable.positions, curve, color=BLUE, linewidth=0.8, alpha=0.5, label=label)
    axes.plot(cable.positions, cable.true, color=INK, linewidth=1.6, label="true")
    axes.axhline(0, color=GREY, linewidth=0.6)
    label_axes(axes, "m4 [rad]", "torque less its mean [N·m]")
    legend_above(axes)
    return figure


def arm_section(name: str, found: Identified) -> Section:
    """Return coverage and the spring of one arm."""
    at = found.names.index(SPRING[name])
    spring, true = found.values[:, at], found.truth[at]
    error = spring.std(ddof=1) / np.sqrt(len(spring))
    seen = Check(
        f"{100 * found.coverage:.1f} ± {100 * found.spread:.1f} %",
        found.coverage >= LEAST,
        f"at least {100 * LEAST:.0f} %",
    )
    near = abs(spring.mean() - true) <= max(3 * error, 0.01 * true)
    facts = {
        "parameters": len(found.names),
        "95 % intervals that hold the truth": seen,
        "called identifiable": f"{found.identifiable.mean():.1f}",
        "ε_RA of unseen motion": f"{100 * found.errors.mean():.2f} %",
        "spring": Check(f"{spring.mean():.4g} ± {spring.std(ddof=1):.2g}", bool(near), f"{true:g}"),
    }
    worst = pd.DataFrame(
        {
            "parameter": found.names,
            "true": [f"{x:.4g}" for x in found.truth],
            "mean fitted": [f"{x:.4g}" for x in found.values.mean(0)],
            "standard deviation": [f"{x:.2g}" for x in found.values.std(0, ddof=1)],
            "held by": [f"{100 * x:.0f} %" for x in found.hits.mean(0)],
        }
    )
    title = campaign(name).robot.title
    blocks = (frame_table(pd.DataFrame([facts])), frame_table(worst, "Every parameter"))
    return Section(name, title, f"{len(spring)} seeds.", blocks)


def cable_section(cable: Cable) -> Section:
    """Return what a cable costs that is not given, and what is learned of it."""
    given, out, learned = cable.errors.mean(0)
    ratio = Check(
        f"{cable.ratio.mean():.3f} (largest {cable.ratio.max():.3f})",
        bool(cable.ratio.mean() <= MOST),
        f"at most {MOST} in the mean",
    )
    row = {
        "given": f"{1000 * given:.2f} mN·m",
        "left out": f"{1000 * out:.2f} mN·m",
        "learned": f"{1000 * learned:.2f} mN·m",
        "learned over given": ratio,
        "curve, relative rms difference": f"{100 * cable.apart:.1f} %",
    }
    said = tuple(f"Seed {k}: diagnose names {text}." for k, text in enumerate(cable.named))
    return Section(
        "cable",
        "The cable of the master arm",
        "RMS error of the platform's torque on unseen motion; learned is a B-spline along m4.",
        (frame_table(pd.DataFrame([row])), Picture(draw_cable(cable)), Prose(said)),
    )


def state(found: dict[str, Identified], cable: Cable) -> str:
    """Return the answer in plain words."""
    arms = "; ".join(
        f"{name}: {100 * one.coverage:.1f} ± {100 * one.spread:.1f} % of {len(one.names)} "
        f"intervals hold the truth, {SPRING[name]} = "
        f"{one.values[:, one.names.index(SPRING[name])].mean():.4g} "
        f"(true {one.truth[one.names.index(SPRING[name])]:g})"
        for name, one in found.items()
    )
    return (
        f"{arms}. Learned, the cable leaves {cable.ratio.mean():.3f} × the error of the true one "
        f"on unseen motion (at most {cable.ratio.max():.3f}); left out "
        f"{(cable.errors[:, 1] / cable.errors[:, 0]).mean():.2f} ×."
    )


def write(found: dict[str, Identified], cable: Cable, out: Path) -> None:
    """Write the page and the numbers, and print where."""
    counts = frame_table(pd.DataFrame([count(name) for name in ARMS]))
    method = (
        f"Torque noise of {100 * NOISE.additive:g} % of each joint's rms with correlation "
        f"{NOISE.correlation:g} from sample to sample, encoders of {NOISE.encoder:g} rad or m, no "
        "velocities; three motions of 12 s at 100 Hz fitted, a fourth held out. Inertias, friction "
        "and rotors are ours, so absolute errors are those of the noise and not the published ones."
    )
    sections = [
        Section("counts", "Base parameters", "Beside those published.", (counts,)),
        *(arm_section(name, one) for name, one in found.items()),
        cable_section(cable),
        Section("method", "Method", "", (Prose((method,)),)),
    ]
    out.parent.mkdir(parents=True, exist_ok=True)
    data: dict[str, Any] = {
        "schema": "identifiability/study/dvrk/1",
        "statement": state(found, cable),
        "arms": {
            name: {
                "names": one.names,
                "truth": one.truth,
                "values": one.values,
                "coverage": one.coverage,
                "coverage_se": one.spread,
                "held": one.hits.mean(0),
            }
            for name, one in found.items()
        },
        "cable": {"errors": cable.errors, "apart": cable.apart, "named": cable.named},
    }
    print(state(found, cable))
    print(write_json(out, data))
    page = out.with_suffix(".html")
    title = "Two published arms, identified back"
    print(write_page(title, state(found, cable), sections, page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="dvrk", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "dvrk.json")
    parser.add_argument("--quick", action="store_true", help="2 seeds instead of 20")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--diagnosed", type=int, default=3, help="seeds that diagnose sees as well")
    given = parser.parse_args(argv)
    seeds, diagnosed = (2, 0) if given.quick else (given.seeds, given.diagnosed)

    def say(text: str, done: float) -> None:
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{text}: {100 * done:.0f} %   ")

    found = {name: identify(name, seeds, say) for name in ARMS}
    write(found, learn_cable(seeds, diagnosed, say), given.out)


if __name__ == "__main__":
    main()
