"""Can foreign and spoilt logs be read, and are their problems named?

A corpus of more than a hundred logs, made with fixed seeds from good simulated ones: text and
containers of other programs, other names, clocks and units, lost and wrong samples, torque that is
none. For each log the expected answer of a good engineer is known. A log is *read right* if the
unpruned model fitted to it predicts the torque that the model of the good log predicts; *named* if
a sentence or hint holds the cause; *warned* if it is read wrongly and a hint says something else;
and *wrong with confidence* if it is read wrongly and nothing is said. False alarms on good logs are
counted, too: simulated ones with noise of many kinds, and real ones where they are there.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from foreign import CASES
from foreign.case import Case
from foreign.good import FINDERS, false_frame
from shared import study_parser

from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.regression.regression import Regression
from identifiability.report import Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import Noise, random_trajectory, simulate
from identifiability.workflows.analyze import Analysis, analyze

SAMPLES, SEED = 800, 3

#: Noise of the good logs: of torque, as a share of it, and steps of the encoder [rad or m].
NOISE = Noise(torque=0.02, encoder=1e-5)

#: A log is read right if no joint's predicted torque differs by more than this share.
RIGHT = 0.05

#: Outcomes, from best to worst.
OUTCOMES = (
    "read right",
    "named",
    "warned",
    "refused otherwise",
    "wrong with confidence",
    "traceback",
)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a log.

    Attributes
    ----------
    case : Case
    outcome : str
        One of `OUTCOMES`.
    said : str
        The sentence that refused it, or all hints.
    differs : float
        Largest difference of a joint's predicted torque, as a share; NaN where it was refused.
    """

    case: Case
    outcome: str
    said: str
    differs: float = float("nan")

    @property
    def good(self) -> bool:
        """Whether the answer is that of a good engineer."""
        if self.case.quiet:
            return self.outcome == "read right" and not self.said
        if self.case.never:
            return self.outcome == "named"
        return self.outcome in ("read right", "named")


@cache
def good_log(name: str, lock: tuple[str, ...] = ()) -> Log:
    """Return the good log of a shipped robot, some of its joints locked."""
    robot, rng = Robot.load(name, lock=list(lock)), np.random.default_rng(SEED)
    motion = random_trajectory(robot, rng, samples=SAMPLES)
    return replace(simulate(robot, motion, noise=NOISE, rng=rng), dq=None, ddq=None)


def fit(robot: Robot, log: Any) -> Analysis:
    """Return the analysis of a log, without slow options."""
    return analyze(robot, log, replicates=0)


@cache
def good_torque(name: str, lock: tuple[str, ...] = ()) -> tuple[Regression, np.ndarray]:
    """Return the regression of the good log, and the torque (N, n) that its model predicts."""
    result = fit(Robot.load(name, lock=list(lock)), good_log(name, lock))
    regression = result.structure.regression(result.samples)
    return regression, predict(regression, result)


def predict(regression: Regression, result: Analysis) -> np.ndarray:
    """Return the torque that the unpruned model of a result predicts along a motion, (N, n)."""
    full = result.models[-1]
    for model in result.models:
        if len(model.submodel) > len(full.submodel):
            full = model
    values = full.submodel.expand(full.estimate.value)
    return np.concatenate([c.W @ values for c in regression.chunks()])


def compare(case: Case, result: Analysis) -> float:
    """Return the largest difference of a joint's predicted torque from the good log's."""
    regression, good = good_torque(case.robot, case.lock)
    there = predict(result.structure.regression(regression.samples), result)
    spread = good.std(0)
    kept = [j not in case.unmeasured for j in regression.robot.joints]
    return float((np.sqrt(np.mean((there - good) ** 2, 0)) / spread)[kept].max())


def try_case(case: Case, folder: Path) -> Outcome:
    """Write a log, analyse it, and judge the remarks."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(SEED)
    path = case.write(good_log(case.robot, case.lock).to_frame(), folder, rng)
    try:
        robot = _robot(case, folder)
        result = fit(robot, path)
    except IdentifiabilityError as error:
        said = str(error)
        return Outcome(case, "named" if _holds(case, said) else "refused otherwise", said)
    except Exception as error:  # noqa: BLE001 - a traceback is an outcome
        return Outcome(case, "traceback", f"{type(error).__name__}: {error}")
    # That offsets are assumed to be zero is a condition of some verdicts, of good logs, too.
    hints = [x for x in result.hints if getattr(x, "key", "") != "excluded_offsets"]
    said, differs = "\n".join(hints), compare(case, result)
    if result.nothing:
        said = "\n".join([said, result.statement]).strip()
    if differs < RIGHT:
        return Outcome(case, "read right", said, differs)
    notes = [note for s in result.samples for note in s.notes]
    # The statement begins with masses that disagree with the file's.
    if _holds(case, "\n".join((said, *notes, result.statement))):
        return Outcome(case, "named", said, differs)
    return Outcome(case, "warned" if said else "wrong with confidence", said, differs)


def _holds(case: Case, said: str) -> bool:
    return any(word.casefold() in said.casefold() for word in case.words)


def _robot(case: Case, folder: Path) -> Robot:
    """Return the robot, with the sidecar of the case."""
    options: dict[str, Any] = {"columns": dict(case.columns) or None, "lock": list(case.lock)}
    if not case.sidecar and case.scene is None:
        return Robot.load(case.robot, **options)
    shipped = Robot.load(case.robot)
    own = "" if shipped.sidecar is None else shipped.sidecar.read_text()
    path = folder / shipped.path.name
    text = shipped.path.read_text()
    path.write_text(text if case.scene is None else case.scene(text))
    for ladder in shipped.path.parent.glob("ladder.toml"):
        (folder / ladder.name).write_text(ladder.read_text())
    path.with_suffix(".toml").write_text(f"{own}\n{case.sidecar}")
    return Robot.load(path, **options)


def run(cases: Sequence[Case]) -> Iterator[Outcome]:
    """Yield the outcome of each log."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        for k, case in enumerate(cases):
            yield try_case(case, Path(folder) / str(k))


def outcome_frame(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Return one row a log."""
    return pd.DataFrame(
        [
            {
                "log": o.case.name,
                "family": o.case.family,
                "outcome": o.outcome,
                "as an engineer would": "yes" if o.good else "no",
                "difference [%]": "" if np.isnan(o.differs) else f"{100 * o.differs:.2g}",
                "said": o.said,
            }
            for o in outcomes
        ]
    )


def count_frame(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Return one row a family."""
    families = list(dict.fromkeys(o.case.family for o in outcomes))
    rows = []
    for family in [*families, "all"]:
        own = [o for o in outcomes if family in (o.case.family, "all")]
        counts = {name: sum(o.outcome == name for o in own) for name in OUTCOMES}
        rows.append({"family": family, "logs": len(own), **counts})
    return pd.DataFrame(rows)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the study."""
    parser = study_parser("foreign_logs", __doc__, "every twelfth log, no good ones")
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    parser.add_argument("--only", help="families or names that hold this text")
    parser.add_argument("--seeds", type=int, default=2, help="random motions a robot, twice")
    given = parser.parse_args(argv)
    cases = [c for c in CASES if not given.only or given.only in f"{c.family}: {c.name}"]
    cases, given.seeds = (cases[::12], 0) if given.quick else (cases, given.seeds)
    outcomes = []
    for o in run(cases):
        outcomes.append(o)
        mark = " " if o.good else "!"
        first = o.said.replace("\n", " | ")
        print(f"{mark} {o.case.family:10s} {o.case.name:36s} {o.outcome:22s} {first}", flush=True)
    counts, table = count_frame(outcomes), outcome_frame(outcomes)
    print(counts.to_string(index=False))
    good = sum(o.good for o in outcomes)
    wrong = sum(o.outcome == "wrong with confidence" for o in outcomes)
    statement = (
        f"Of {len(outcomes)} foreign and spoilt logs {good} are read right or their fault is "
        f"named; {wrong} are read wrongly without a word."
    )
    false = pd.DataFrame()
    if given.seeds:
        false = false_frame(given.seeds, given.data)
        print(false.T.to_string(header=False))
        most, logs = int(false[list(FINDERS)].iloc[-1].max()), int(false["logs"].iloc[-1])
        statement += f" No hint is given of more than {most} of {logs} good logs."
    print(statement)
    sections = (
        Section("counts", "By family", "How often what.", (frame_table(counts),)),
        Section(
            "logs", "Log by log", "What became of each, and what was said.", (frame_table(table),)
        ),
        Section(
            "good", "Good logs", "How many of them each finder speaks of.", (frame_table(false),)
        ),
    )[: 3 if given.seeds else 2]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    result = {
        "schema": "identifiability/study/foreign_logs/1",
        "statement": statement,
        "counts": counts.to_dict("records"),
        "logs": table.to_dict("records"),
        "good_logs": false.to_dict("records"),
    }
    print(write_json(given.out, result))
    page = given.out.with_suffix(".html")
    print(write_page("Do foreign logs get in?", statement, sections, page, overline="Study"))
    return result


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
