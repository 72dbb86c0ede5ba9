"""Throw spoilt files at every reader: whatever they hold, only our own sentences come out.

Run in a process of its own, so that a crash of a C++ parser is seen: ``python fuzz.py 10000 mjcf``.
The file of the moment lies in the folder that is printed first; the first thing that is no sentence
of ours ends the run. Each reader prints how many files it read and how many it refused.
"""

import faulthandler
import io
import json
import shutil
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from spoil import JSON, TABLE, TOML, XML, Spoilt, spoil_bytes, spoil_document, spoil_xml, to_toml

from identifiability import IdentifiabilityError, Log, Robot, export, prepare_log, simulate
from identifiability.logs.conventions import Conventions
from identifiability.regression.reduction import (
    build_ladder,
    default_ladder,
    ladder_model,
    read_ladder,
)
from identifiability.regression.structure import Structure
from identifiability.robot.locate import locate_robot
from identifiability.simulation import PrescribedMotion, read_trajectories, shipped_trajectory

#: Seconds after which one input counts as a hang.
PATIENCE = 120

#: Letters of the longest sentence that anybody reads.
LONGEST = 800

LADDER = """
[[models]]
name = "a"
effects = ["rigid_body", "viscous_friction"]
[[models]]
name = "b"
from = "a"
zero = ["link1.mz"]
hold = {"elbow.Fv" = 0.5}
keep = ["link2.mx"]
"""


@dataclass(frozen=True)
class Reader:
    """File suffix, a good file, ways to spoil it and how to read it."""

    suffix: str
    good: bytes
    spoilt: Spoilt
    read: Callable[[Path], object]


@cache
def readers():
    """Every reader by its name."""
    two = Robot.load("two-link")
    structure = Structure.of(two, ladder_model(default_ladder(two)))
    frame = simulate(two, PrescribedMotion.of(shipped_trajectory(two, "a"), 30)).to_frame()
    values = {k: float(v) for k, v in two.nominal.items()}
    physical = {"parameters": values, "error_ra": 0.05, "error_ra_file": 0.06}
    result = {"robot": {"name": two.name}, "physical": physical}
    sidecar = locate_robot("five-bar").with_suffix(".toml").read_bytes()
    motions = (locate_robot("two-link").parent / "trajectories.json").read_bytes()

    known = Conventions.of(two)

    def log(path):
        return prepare_log(two, Log.read(path, known))

    def ladder(path):
        entry = read_ladder(path)
        ladder_model(entry)
        return build_ladder(entry, structure)

    def motion(path):
        known = read_trajectories(path, two)
        return [PrescribedMotion.of(t, min(t.samples, 100)) for t in known.values()]

    def document(suffix, good, tokens, read):
        parse, dump = (tomllib.loads, to_toml) if suffix == ".toml" else (json.loads, json.dumps)
        spoilt = st.one_of(spoil_bytes(good, tokens), spoil_document(parse(good.decode()), dump))
        return Reader(suffix, good, spoilt, read)

    def markup(suffix, name):
        good = locate_robot(name).read_bytes()
        return Reader(suffix, good, st.one_of(spoil_xml(good), spoil_bytes(good, XML)), Robot.load)

    def table(suffix, good, tokens):
        return Reader(suffix, good, spoil_bytes(good, tokens), log)

    arrays = {kind: frame[[f"{j}.{kind}" for j in two.joints]] for kind in ("q", "tau")}
    held = {"t": frame["t"].to_numpy(), **{kind: x.to_numpy() for kind, x in arrays.items()}}
    zipped = io.BytesIO()
    matlab = io.BytesIO()
    np.savez(zipped, **held)
    savemat(matlab, {"run": held})
    return {
        "csv": table(".csv", frame.to_csv(index=False).encode(), TABLE),
        "parquet": table(".parquet", frame.to_parquet(), [b"PAR1", b"\0" * 8]),
        "npz": table(".npz", zipped.getvalue(), [b"PK"]),
        "mat": table(".mat", matlab.getvalue(), [b"miM"]),
        "ladder": document(".toml", LADDER.encode(), TOML, ladder),
        "sidecar": document(".toml", sidecar, TOML, lambda p: Robot.load("five-bar", p)),
        "result": document(
            ".json",
            json.dumps(result).encode(),
            JSON,
            lambda p: export(two, p, p.with_name("exported.xml")),
        ),
        "trajectories": document(".json", motions, JSON, motion),
        "mjcf": markup(".xml", "five-bar"),
        "urdf": markup(".urdf", "six-dof-arm"),
    }


def check_sentence(sentence):
    """Refuse what a user cannot read in one go, or a terminal not print."""
    sentence.encode()
    if "\n" in sentence or len(sentence) > LONGEST or sentence[-1:] not in (".", "?"):
        raise AssertionError(f"no readable sentence ({len(sentence)} letters): {sentence[:300]!r}")


def fuzz(name, examples, folder):
    """Read many spoilt files; return how many were read, and how many refused.

    Raises
    ------
    Exception
        The first that is no sentence of ours.
    """
    reader = readers()[name]
    refused = []
    path = folder / f"{name}{reader.suffix}"
    path.write_bytes(reader.good)
    reader.read(path)

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(reader.spoilt)
    def check(content):
        path.write_bytes(content)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        try:
            reader.read(path)
            refused.append(False)
        except IdentifiabilityError as error:
            check_sentence(str(error).replace(str(path), path.name))
            refused.append(True)
        finally:
            faulthandler.cancel_dump_traceback_later()

    check()
    return refused.count(False), refused.count(True)


if __name__ == "__main__":
    warnings.simplefilter("error")
    examples, *names = sys.argv[1:]
    place = tempfile.mkdtemp()
    print(place, flush=True)
    for name in names or readers():
        print(name, *fuzz(name, int(examples), Path(place)), flush=True)
    shutil.rmtree(place)  # kept only after a failure
