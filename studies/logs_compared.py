"""Does `compare` name changes between logs, and leave an unchanged robot alone?

    python studies/logs_compared.py [--stream 0] [--only NAME] [--real]

Arms of three to seven joints that are drawn, and closed chains, each with two logs before and one
after, of other motions: 20 s at 100 Hz, torque by MuJoCo. Friction is 15–25 % of it and differs by
3 % between any two logs. Noise is 3 % with a memory of ten samples. `right` counts cases in which
only the planted change is named. In `or` it is one of "A or B", and in `more` there are other
changes, too. Further columns count sizes within their 95 % intervals: of the named change by
`compare`, and of the mass by `payload`. `missed` counts loads that payload weighs at 15 σ and more
and compare calls unchanged. Where constants are off, all torque columns have one wrong factor,
5–15 % off, each body of the robot file errs by 5 %, and only `payload` is judged. The smallest
change of friction is the one that `compare` of unchanged logs says it would have named. Checks
require that it is named in .95, and that coverage does not differ from .93 … .97, but by chance.
`--real` compares logs of real arms without a known change.
"""

from __future__ import annotations

import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from drawn_robots import draw_arm
from paper_study.result import StudyCheck
from real_logs import cut, find_cases
from shared import study_parser, write_answer

from identifiability import Log, Robot, analyze, compare, payload
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rounding import REACH, exact_share
from identifiability.robot.robot import tool_bodies
from identifiability.simulation import PrescribedMotion, random_trajectory
from identifiability.simulation.forces import joint_torque
from identifiability.simulation.mujoco_robot import MujocoRobot
from identifiability.simulation.simulator import ar1

CHAINS = ("five-bar", "3-rrr", "delta")
BEFORE, AFTER, SECONDS, RATE, HARMONICS = 2, 1, 20.0, 100, 10
#: Noise as a share of how much torque varies, its AR(1), the drift of friction between two logs.
NOISE, MEMORY, DRIFT = 0.03, 0.9, 0.03
#: Changes, their sizes, and their number in sixty cases.
CHANGES = {
    "nothing": (None, 0.0, 60),
    ".2 kg": ("load", 0.2, 40),
    ".6 kg": ("load", 0.6, 40),
    "gain + 3 %": ("gain", 0.03, 40),
    "Coulomb friction + 15 %": ("friction", 0.15, 40),
    "1 kg, constants off": ("load", 1.0, 40),
    "Coulomb friction, smallest that is seen": ("friction", np.nan, 40),
}
#: The change of which only `payload` is judged, how far its torque constants are off, and how far
#: bodies of its robot file.
CONSTANTS = "1 kg, constants off"
OFF, FILE = (0.05, 0.15), 0.05
#: The change of the size that `compare` states for unchanged logs, and how often it must be named.
LEAST = "Coulomb friction, smallest that is seen"
SEEN = 0.95
#: Required coverage, and the largest median half-width of a mass where constants are off.
COVERAGE = 0.93, 0.97
WIDTH = 0.06


@dataclass(frozen=True)
class Case:
    """A robot, its logs before and after, and what changed.

    `size` is that of the first number of the change [kg, 1 or N·m].
    """

    robot: Robot
    before: list[Log]
    after: list[Log]
    kind: str | None
    place: str
    size: float


def draw_case(
    stream: int, seed: int, change: str, folder: Path, share: float | None = None
) -> Case:
    """Return a case; for one seed, robots, motions and noise are the same for every change.

    A share is the size of the change instead of the usual one.
    """
    kind, usual, _ = CHANGES[change]
    much = usual if share is None else share
    rng = np.random.default_rng([stream, seed])
    if seed % 6 == 5:
        robot = Robot.load(CHAINS[rng.integers(len(CHAINS))])
    else:
        robot = draw_arm(rng, folder, "".join(rng.choice(list("RRRRP"), int(rng.integers(3, 8)))))
    joint = int(rng.integers(len(robot.joints)))
    body = tool_bodies(robot)[0]
    own = MujocoRobot(robot)
    loaded, scale = own, 1.0
    if change == CONSTANTS:
        scale += float(rng.choice([-1.0, 1.0]) * rng.uniform(*OFF))
    if kind == "load":
        centre, size = rng.uniform(-0.05, 0.05, 3), rng.uniform(0.03, 0.1, 3) ** 2
        moments = much * np.array([size[1] + size[2], size[0] + size[2], size[0] + size[1]])
        loaded = MujocoRobot(
            robot.with_payload(mass=much, centre=centre, inertia=moments, body=body)
        )
    values, noise, logs = dict(robot.nominal), np.empty(0), []
    for k in range(BEFORE + AFTER):
        draw = np.random.default_rng([stream, seed, k])
        shape = random_trajectory(robot, draw, period=SECONDS, harmonics=HARMONICS)
        move = PrescribedMotion.of(shape, int(SECONDS * RATE))
        rigid = own.inverse_dynamics(move.q, move.dq, move.ddq)
        if not k:
            values |= _friction(robot, rigid.tau.std(0), move.dq.std(0), draw)
            noise = NOISE * rigid.tau.std(0)
        changed = k >= BEFORE
        torque = rigid.tau
        if changed and kind == "load":
            torque = loaded.inverse_dynamics(move.q, move.dq, move.ddq).tau
        torque = torque + joint_torque(robot, move, rigid, _drifted(values, draw))
        if changed and kind == "friction":
            level = much * values[f"{robot.joints[joint]}.Fc"]
            torque[:, joint] += level * np.sign(move.dq[:, joint])
        if changed and kind == "gain":
            torque[:, joint] *= 1.0 + much
        torque = scale * (torque + noise * ar1(torque.shape, MEMORY, draw))
        logs.append(_log(robot, move, torque, k))
    if change == CONSTANTS:
        robot = _misstated(robot, rng)
    place = body if kind == "load" else robot.joints[joint]
    planted = much * values[f"{place}.Fc"] if kind == "friction" else much
    return Case(robot, logs[:BEFORE], logs[BEFORE:], kind, place, planted)


def draw_least(stream: int, seed: int, folder: Path) -> Case | None:
    """Return a case with the smallest change that `compare` states for unchanged logs.

    None if it states no size.
    """
    case = draw_case(stream, seed, LEAST, folder, 0.0)
    stated = compare(case.robot, case.before, case.after).unchanged
    friction = ("coulomb_friction", case.place)
    shares = [number.share for number in stated if (number.family, number.place) == friction]
    if not shares or not np.isfinite(shares[0]):
        return None
    return draw_case(stream, seed, LEAST, folder, shares[0])


def _misstated(robot: Robot, rng: np.random.Generator) -> Robot:
    """Return a robot whose file states each body too heavy or too light."""
    factors: dict[str, float] = defaultdict(lambda: float(np.exp(FILE * rng.standard_normal())))
    nominal = {}
    for name, value in robot.nominal.items():
        body, _, kind = name.rpartition(".")
        nominal[name] = value * factors[body] if kind in INERTIAL_KINDS else value
    return replace(robot, nominal=nominal)


def _friction(
    robot: Robot, torque: Array, speed: Array, rng: np.random.Generator
) -> dict[str, float]:
    """Return friction of drives of the size of geared robots."""
    out: dict[str, float] = {}
    for j, joint in enumerate(robot.joints):
        dry = rng.uniform(0.3, 1.0) * 0.15 * torque[j]
        out |= {f"{joint}.{kind}": dry for kind in ("Fc", "Fc+", "Fc-")}
        out[f"{joint}.Fv"] = rng.uniform(0.3, 1.0) * 0.1 * torque[j] / speed[j]
    return out


def _drifted(values: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Return values with friction of another day."""
    out = dict(values)
    for name in values:
        if name.rpartition(".")[2] in ("Fc", "Fv"):
            factor = 1.0 + DRIFT / np.sqrt(2.0) * rng.standard_normal()
            out |= {n: factor * x for n, x in values.items() if n.rstrip("+-") == name}
    return out


def _log(robot: Robot, move: PrescribedMotion, torque: Array, number: int) -> Log:
    columns: dict[str, Array] = {"t": move.t}
    for j, joint in enumerate(robot.joints):
        channels = {"q": move.q, "dq": move.dq, "ddq": move.ddq, "tau": torque}
        columns |= {f"{joint}.{kind}": x[:, j] for kind, x in channels.items()}
    return Log.from_frame(pd.DataFrame(columns), f"log {number + 1}")


def judge(case: Case) -> dict[str, Any]:
    """Return the outcome of a case, and the error of the named size in σ."""
    found = compare(case.robot, case.before, case.after)
    named = [(c.kind, c.place) for c in found.changes]
    right = [] if case.kind is None else [(case.kind, case.place)]
    others = any(case.place == other.place for c in found.changes for other in c.alternatives)
    told = "wrong"
    if named == right:
        told = "right"
    elif not named:
        told = "silent"
    elif right and set(right) <= set(named):
        told = "more"
    elif others:
        told = "or"
    out: dict[str, Any] = {"said": told, "answer": found.answer}
    planted = [c for c in found.changes if (c.kind, c.place) == (case.kind, case.place)]
    if planted:
        out["compare"] = float(planted[0].sizes[0] - case.size) / planted[0].sd[0]
    return out


def weigh(case: Case) -> dict[str, Any]:
    """Return the error of the mass that `payload` states, its width, and the σ of the load."""
    fit = analyze(case.robot, case.before, replicates=0)
    mass = payload(case.robot, fit, case.after, body=case.place).mass
    sd = mass.half / REACH
    return {
        "payload": (mass.value - case.size) / sd,
        "width": mass.half / case.size,
        "sigmas": mass.value / sd,
    }


def run(stream: int, change: str, count: int, folder: Path) -> list[dict[str, Any]]:
    """Return one row a case."""
    rows = []
    for seed in range(count):
        if change == LEAST:
            case = draw_least(stream, seed, folder)
        else:
            case = draw_case(stream, seed, change, folder)
        if case is None:
            continue
        row: dict[str, Any] = {"change": change, "said": ""}
        if change != CONSTANTS:
            row |= judge(case)
        if case.kind == "load":
            row |= weigh(case)
        rows.append(row)
        if row["said"] != "right":
            print(f"  {change}, {seed}, {case.robot.name}, {case.place}: {row}", flush=True)
    return rows


def summarize(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the rate at which changes of one kind are named, and how many sizes hold."""
    said = Counter(row["said"] for row in rows if row["said"])
    out: dict[str, Any] = {"change": rows[0]["change"], "cases": len(rows), **said}
    for who in ("compare", "payload"):
        held, total = count_held(rows, who)
        out[f"size inside, {who}"] = f"{held} of {total}" if total else ""
    widths = [row["width"] for row in rows if "width" in row]
    out["median half-width, payload"] = f"{np.median(widths):.3f}" if widths else ""
    sure = [row for row in rows if row["said"] and row.get("sigmas", 0.0) > 15]
    out["missed"] = f"{sum(row['said'] == 'silent' for row in sure)} of {len(sure)}"
    print(out, flush=True)
    return out


def count_held(rows: list[dict[str, Any]], who: str) -> tuple[int, int]:
    """Return how many sizes lie in their 95 % intervals, and how many are stated."""
    errors = [abs(row[who]) for row in rows if who in row]
    return sum(x < REACH for x in errors), len(errors)


def check_coverage(name: str, rows: list[dict[str, Any]], who: str) -> StudyCheck:
    """Return whether coverage of some sizes differs from the required one by chance at most."""
    held, total = count_held(rows, who)
    share = exact_share(held, total)
    passed = share.low <= COVERAGE[1] and share.high >= COVERAGE[0]
    text = f"{held} of {total} ({share.low:.3f} … {share.high:.3f})"
    limits = f"{COVERAGE[0]} … {COVERAGE[1]}"
    return StudyCheck(f"coverage of {name}", text, limits, "chance", passed)


def check_least(rows: list[dict[str, Any]]) -> StudyCheck:
    """Return whether changes of the smallest size that is seen are named as often as stated."""
    named = sum("compare" in row for row in rows)
    share = exact_share(named, len(rows))
    text = f"{named} of {len(rows)} ({share.low:.3f} … {share.high:.3f})"
    return StudyCheck(f"named: {LEAST}", text, f"{SEEN}", "chance", share.high >= SEEN)


def find_checks(rows: list[dict[str, Any]]) -> list[StudyCheck]:
    """Return the required checks of the sizes that are stated."""
    checks = []
    if any("compare" in row for row in rows):
        checks.append(check_coverage("sizes by compare", rows, "compare"))
    least = [row for row in rows if row["change"] == LEAST]
    if least:
        checks.append(check_least(least))
    off = [row for row in rows if row["change"] == CONSTANTS]
    if off:
        checks.append(check_coverage("masses where constants are off", off, "payload"))
        width = float(np.median([row["width"] for row in off]))
        name = "median half-width of these masses"
        checks.append(StudyCheck(name, f"{width:.3f}", f"{WIDTH}", "", width <= WIDTH))
    return checks


def real_pairs(
    data: Path | None, folder: Path
) -> Iterator[tuple[str, Robot, list[Log], list[Log]]]:
    """Yield logs of real arms without a known change."""
    seen: set[str] = set()
    for name, robot, fitted, other in find_cases(data, folder):
        arm = name.partition(" ")[0]
        yield name, robot, fitted, [other]
        if arm not in seen and len(fitted) == 1:
            halves = cut(fitted[0], 2)
            yield f"{name}, halves of the first", robot, halves[:1], halves[1:]
        seen.add(arm)


def main(argv: Sequence[str] | None = None) -> pd.DataFrame:
    """Run the study."""
    parser = study_parser("logs_compared", __doc__, "two cases of each")
    parser.add_argument("--stream", type=int, default=0, help="of the seeds")
    parser.add_argument("--only", default="", help="changes whose names hold this text")
    parser.add_argument("--real", action="store_true", help="logs of real arms instead")
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    asked = parser.parse_args(argv)
    rows: list[dict[str, Any]] = []
    cases: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if asked.real:
            for case, robot, before, after in real_pairs(asked.data, folder):
                compared = compare(robot, before, after)
                odds = [c.odds for c in compared.changes]
                rows.append({"case": case, "said": compared.answer, "log odds": odds})
                print(rows[-1], flush=True)
        else:
            for change, (_, _, count) in CHANGES.items():
                if asked.only in change:
                    found = run(asked.stream, change, 2 if asked.quick else count, folder)
                    cases += found
                    rows.append(summarize(found))
    frame = pd.DataFrame(rows)
    checks = find_checks(cases)
    statement = f"What is said of {len(rows)} kinds of logs that were compared."
    tables = {"Cases": frame}
    if checks:
        tables["Required checks"] = pd.DataFrame([asdict(check) for check in checks])
        print(tables["Required checks"].to_string(index=False))
    write_answer(asked.out, "Logs compared", statement, tables, __doc__)
    failed = [check.name for check in checks if not check.passed]
    if failed and not asked.quick:
        raise SystemExit(f"Required checks failed: {'; '.join(failed)}.")
    return frame


if __name__ == "__main__":
    main()
