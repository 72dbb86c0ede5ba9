"""What do models err on motion of real robots that was neither fitted nor chose anything?

    python studies/real_logs.py [--only NAME] [--prune | --diagnose]

The model that an analysis of the fitted logs alone would use: as estimated, as the nearest real
robot, and as it recommends; with `--prune` the unpruned and the pruned model, too. With
`--diagnose` the effects that are named on some logs and stand on the other, the error there before
and after, those that the other refutes, and which name of one part of a robot's data another part
refutes.

KUKA LWR4+ run 1 → 3 and 3 → 1, two of the first two thirds of a TX40's log on each other, halves of
a UR10's on each other, a KR300 A, C → B and A, B → C. The folder of the data is
$IDENTIFIABILITY_DATA.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import kuka_lwr4
import staubli_tx40

from identifiability import Log, Robot, analyze, diagnose
from identifiability.logs.conventions import Conventions
from identifiability.physical.cad_prior import total_mass
from identifiability.workflows.diagnose.words import contradiction
from identifiability.workflows.prune import prune

ROOT = Path(__file__).resolve().parents[1]

Case = tuple[str, Robot, list[Log], Log]


def cut(log: Log, parts: int) -> list[Log]:
    """Return equal stretches of a log, each as a log of its own."""
    edges = [k * len(log.t) // parts for k in range(parts + 1)]
    return [
        replace(log.cut(a, b, f"part {k + 1}"), sha256=f"{k}")
        for k, (a, b) in enumerate(pairwise(edges))
    ]


def find_cases(data: Path, folder: Path) -> Iterator[Case]:
    """Yield name, robot, fitted logs and the log that is held out."""
    where = data / "kuka_lwr4"
    robot = kuka_lwr4.load_robot(where)
    runs = {k: kuka_lwr4.load_log(where, robot, k) for k in (1, 3)}
    for fitted, other in ((1, 3), (3, 1)):
        yield f"KUKA {fitted} → {other}", robot, [runs[fitted]], runs[other]
    where = data / "staubli_tx40"
    robot = staubli_tx40.load_robot(where)
    thirds = cut(staubli_tx40.load_log(where, robot), 3)[:2]  # the last is nobody's
    where = data / "unisa"
    ur10 = Robot.load(where / "ur10.urdf")
    halves = cut(Log.read(f"{where / 'ur10_exciting.db3'}:/joint_states"), 2)
    for name, arm, pair in (("TX40", robot, thirds), ("UR10", ur10, halves)):
        for fitted, other in ((0, 1), (1, 0)):
            yield f"{name} {fitted + 1} → {other + 1}", arm, [pair[fitted]], pair[other]
    where = data / "kr300"
    out = folder / "kr300.xml"
    convert = [sys.executable, "-m", "identifiability", "convert", where / "dh.toml", "--out", out]
    subprocess.run(convert, check=True, capture_output=True)
    heavy = Robot.load(out)
    logs = {k: Log.read(where / f"{k}.csv", Conventions.of(heavy)) for k in "ABC"}
    for fitted, other in (("AC", "B"), ("AB", "C")):
        name = f"KR300 {', '.join(fitted)} → {other}"
        yield name, heavy, [logs[k] for k in fitted], logs[other]


def main() -> None:
    """Print a row a case."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default="")
    parser.add_argument("--prune", action="store_true")
    parser.add_argument("--diagnose", action="store_true")
    asked = parser.parse_args()
    named: dict[str, set[str]] = {}
    refused: dict[str, dict[str, str]] = {}
    data = Path(os.environ.get("IDENTIFIABILITY_DATA", ROOT.parent / "shared" / "data"))
    with tempfile.TemporaryDirectory() as folder:
        for name, robot, fitted, other in find_cases(data, Path(folder)):
            if asked.only in name and asked.diagnose:
                print(
                    f"{name}: {state_diagnosed(name, robot, fitted, other, named, refused)}",
                    flush=True,
                )
            elif asked.only in name:
                print(f"{name}: {state(robot, fitted, other)}", flush=True)
                if asked.prune:
                    print(f"{name}, pruned: {state_pruned(robot, fitted, other)}", flush=True)


def state(robot: Robot, fitted: list[Log], other: Log) -> str:
    """Return the errors of what an analysis of some logs alone recommends on another."""
    alone, told = analyze(robot, fitted, replicates=0), analyze(robot, fitted, other, replicates=0)
    at = alone.selected
    used, seen = alone.models[at], told.models[at]
    free, real = 100 * seen.error_ra_validation, 100 * seen.error_ra_physical
    mass = total_mass(robot, used.physical.parameters())
    return (
        f"{used.name}, {len(used.submodel)} parameters: estimated {free:.2f} %, nearest real robot "
        f"{real:.2f} % (prior {used.physical.cad_weight:g}, {mass:.4g} kg of "
        f"{total_mass(robot, robot.nominal):.4g}), recommended "
        f"{real if used.physical_used else free:.2f} %; expected "
        f"{100 * used.error_ra_validation:.2f} and {100 * used.error_ra_physical:.2f} %"
    )


def state_pruned(robot: Robot, fitted: list[Log], other: Log) -> str:
    """Return errors of the unpruned and the pruned model, and those over joints' own scales."""
    found = prune(robot, fitted, other, replicates=0)
    text = [
        f"{len(r)}: {100 * r.error_ra_validation:.2f} % ({100 * r.error_joints_validation:.2f} %)"
        for r in (found.full, found.chosen)
    ]
    return f"unpruned {text[0]}, pruned {text[1]}"


def state_diagnosed(
    name: str,
    robot: Robot,
    fitted: list[Log],
    other: Log,
    named: dict[str, set[str]],
    refused: dict[str, dict[str, str]],
) -> str:
    """Return what a diagnosis names, and keep what stands and what does not of each robot."""
    found, arm = diagnose(robot, fitted, other, forward=False), name.partition(" ")[0]
    stand = {f"{e.name} {p.place}" for e in found.effects for p in e.placements}
    falls = {
        f"{e.name} {p.place}": contradiction(e, found.rules.odds)
        for e in found.refuted
        for p in e.placements
    }
    before, after = 100 * found.held_before, 100 * found.held_after
    names, earlier = named.setdefault(arm, set()), refused.setdefault(arm, {})
    contrary = [f"{k} ({falls[k]} here)" for k in falls.keys() & names]
    contrary += [f"{k} ({earlier[k]} there)" for k in earlier.keys() & stand]
    names |= stand
    earlier |= falls
    text = [
        f"named: {', '.join(sorted(stand)) or 'none'}",
        f"not kept: {', '.join(f'{k} {said}' for k, said in sorted(falls.items())) or 'none'}",
        f"named by one part and not kept by another: {', '.join(sorted(contrary)) or 'none'}",
        f"error {before:.2f} → {after:.2f} %",
    ]
    return "; ".join(text)


if __name__ == "__main__":
    main()
