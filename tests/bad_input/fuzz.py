"""Throw spoilt files at every reader: whatever they hold, only our own sentences come out.

Run in a process of its own, so that a crash of a C++ parser is seen: ``python fuzz.py --examples
10000 --reader mjcf``. The file of the moment lies in the folder that is printed first.
"""

from __future__ import annotations

import argparse
import copy
import faulthandler
import io
import json
import shutil
import tempfile
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from identifiability.errors import IdentifiabilityError
from identifiability.export import read_parameters
from identifiability.grouping import find_base_parameters
from identifiability.ladder import build_ladder, default_ladder, ladder_model, read_ladder
from identifiability.log import Log
from identifiability.robot import Robot
from identifiability.robot.files import locate_robot
from identifiability.samples import prepare_samples
from identifiability.simulation import (
    PrescribedMotion,
    read_trajectories,
    shipped_trajectory,
    simulate,
)

#: Seconds after which one input counts as a hang.
PATIENCE = 20

NUMBERS = [b"nan", b"-inf", b"1e999", b"-1e-320", b"0", b"-1", b"1e18", b"9" * 400, b"0x10", b"1_0"]
TABLE = [b",", b"\n", b"\r\n", b";", b'"', b" ", b"t", b".q", b"elbow.q", b"a,b", b"True", b"#"]
TOML = [b"[", b"]", b"{", b"}", b'"', b"=", b"\n", b"[[models]]", b'name = "a"', b"[limits]", b"."]
JSON = [b"[", b"]", b"{", b"}", b'"', b":", b",", b"null", b"true", b'"sin"', b"NaN", b"[" * 3000]
XML = [
    b"<", b">", b"/>", b'"', b"<!--", b"&lt;", b"0 0 0", b"robot", b"mujoco", b'name=""',
    b"<body>", b"</body>", b'<body name="b"><joint name="j"/></body>', b"<inertial/>", b"<link/>",
    b'<joint type="ball"/>', b'type="free"', b"<mimic/>", b'<default class="c"/>', b"<equality>",
    b'<connect body1="link1" anchor="0 0 0"/>', b'<joint joint1="elbow" joint2="shoulder"/>',
    b'<include file="x.xml"/>',
]  # fmt: skip


VALUES = ["", "0", "nan", "1 2", "1 0 0", "-1 -1 -1", "a", "world", "base", "link_1", "left_distal"]
VALUES += [
    "left_elbow",
    "joint_2",
    "ball",
    "free",
    "slide",
    "continuous",
    "floating",
    "fixed",
    "1e300",
]


def rebuilt(good: bytes) -> st.SearchStrategy[bytes]:
    """XML with some elements gone, doubled or moved, and some attributes gone or changed."""
    whats = ["lose", "double", "move", "lose attribute", "change attribute", "swap attribute"]
    number = st.integers(0, 10_000)
    edit = st.tuples(st.sampled_from(whats), number, number, st.sampled_from(VALUES))

    def apply(edits: list[tuple[str, int, int, str]]) -> bytes:
        root = ET.fromstring(good)
        for what, at, other, value in edits:
            nodes = [(parent, child) for parent in root.iter() for child in parent]
            if not nodes:
                break
            (parent, element), (_, second) = nodes[at % len(nodes)], nodes[other % len(nodes)]
            names = sorted(element.keys()) or ["name"]
            name = names[other % len(names)]
            if what in ("lose", "move"):
                parent.remove(element)
            if what == "double" or (what == "move" and second not in element.iter()):
                (parent if what == "double" else second).append(copy.deepcopy(element))
            if what == "lose attribute":
                element.attrib.pop(name, None)
            elif what == "change attribute":
                element.set(name, value)
            elif what == "swap attribute":
                element.set(name, second.get(name, value))
        return ET.tostring(root)

    return st.lists(edit, min_size=1, max_size=4).map(apply)


def spoilt(good: bytes, tokens: list[bytes]) -> st.SearchStrategy[bytes]:
    """Any bytes, or good ones after a few cuts, copies and insertions."""
    piece = st.one_of(st.sampled_from(tokens + NUMBERS), st.binary(max_size=4))
    place, length = st.integers(0, len(good)), st.integers(0, 60)
    edit = st.tuples(st.sampled_from(["insert", "cut", "copy", "replace"]), place, length, piece)

    def apply(edits: list[tuple[str, int, int, bytes]]) -> bytes:
        out = good
        for what, at, size, new in edits:
            taken = out[at : at + size]
            middle = {"insert": new + taken, "cut": b"", "copy": taken + taken, "replace": new}
            out = out[:at] + middle[what] + out[at + size :]
        return out

    edited = st.lists(edit, min_size=1, max_size=4).map(apply)
    ways = [edited, edited, st.binary(max_size=200)]
    return st.one_of(rebuilt(good), rebuilt(good), *ways) if tokens is XML else st.one_of(ways)


def recorded(frame: pd.DataFrame) -> bytes | None:
    """Return a log as a bag, or None without the extra ``ros``."""
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        return None
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = [f"{k}/msg/{n}" for k, n in (("builtin_interfaces", "Time"), ("std_msgs", "Header"))]
    state = "sensor_msgs/msg/JointState"
    time, header, message = (store.types[k] for k in (*kinds, state))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "bag"
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection("/joint_states", state, typestore=store)
            for k, row in frame.iterrows():
                values = [
                    [row[f"{j}.{c}"] for j in ("shoulder", "elbow")] for c in ("q", "dq", "tau")
                ]
                stamp = time(*divmod(10**9 + round(row["t"] * 1e9), 10**9))
                one = message(header(stamp, ""), ["shoulder", "elbow"], *map(np.array, values))
                writer.write(connection, k * 1_000_000, store.serialize_cdr(one, state))
        return next(folder.glob("*.mcap")).read_bytes()


@cache
def readers() -> dict[str, tuple[str, bytes, list[bytes], Callable[[Path], object]]]:
    """File suffix, a good file, what to spoil it with and how to read it, for each reader."""
    two = Robot.load("two-link")
    ladder = default_ladder(two)
    base = find_base_parameters(two, ladder_model(ladder))
    frame = simulate(two, PrescribedMotion.of(shipped_trajectory(two, "a"), 30)).to_frame()
    parquet = io.BytesIO()
    frame.to_parquet(parquet)
    bag = recorded(frame)
    folder = locate_robot("two-link").parent

    physical = {"parameters": {k: float(v) for k, v in two.nominal.items()}}
    result = json.dumps({"robot": {"name": two.name}, "physical": physical}).encode()

    def model(path: Path) -> object:
        entry = read_ladder(path)
        ladder_model(entry)
        return build_ladder(entry, two, base)

    def motion(path: Path) -> object:
        known = read_trajectories(path, two)
        return [PrescribedMotion.of(t, min(t.samples, 100)) for t in known.values()]

    text = '[[models]]\nname = "a"\neffects = ["rigid_body", "viscous_friction"]\n[[models]]\nname '
    text += (
        '= "b"\nfrom = "a"\nzero = ["link1.mz"]\nhold = {"elbow.Fv" = 0.5}\nkeep = ["link2.mx"]\n'
    )
    bags = (
        {}
        if bag is None
        else {
            "bag": (
                ".mcap",
                bag,
                [b"\x89MCAP0\r\n", b"\0" * 8, b"position", b"sensor_msgs/msg/JointState"],
                lambda p: prepare_samples(two, Log.read(p)),
            ),
        }
    )
    return bags | {
        "csv": (
            ".csv", frame.to_csv(index=False).encode(), TABLE,
            lambda p: prepare_samples(two, Log.read(p)),
        ),
        "parquet": (
            ".parquet", parquet.getvalue(), [b"PAR1", b"\0" * 8],
            lambda p: prepare_samples(two, Log.read(p)),
        ),
        "ladder": (".toml", text.encode(), TOML, model),
        "sidecar": (
            ".toml", locate_robot("five-bar").with_suffix(".toml").read_bytes(), TOML,
            lambda p: Robot.load("five-bar", p),
        ),
        "result": (".json", result, JSON, lambda p: read_parameters(two, p)),
        "trajectories": (".json", (folder / "trajectories.json").read_bytes(), JSON, motion),
        "mjcf": (".xml", locate_robot("five-bar").read_bytes(), XML, Robot.load),
        "urdf": (".urdf", locate_robot("six-dof-arm").read_bytes(), XML, Robot.load),
    }  # fmt: skip


def fuzz(reader: str, examples: int, folder: Path) -> int:
    """Read many spoilt files; return how many were refused."""
    suffix, good, tokens, read = readers()[reader]
    path, refused = folder / f"{reader}{suffix}", 0
    path.write_bytes(good)
    read(path)

    @settings(
        max_examples=examples, deadline=None, database=None, derandomize=True,
        phases=[Phase.generate, Phase.shrink], suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(spoilt(good, tokens))
    def check(content: bytes) -> None:
        nonlocal refused
        path.write_bytes(content)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        try:
            read(path)
        except IdentifiabilityError:
            refused += 1
        finally:
            faulthandler.cancel_dump_traceback_later()

    check()
    return refused


if __name__ == "__main__":
    warnings.simplefilter("error")
    parser = argparse.ArgumentParser()
    parser.add_argument("--examples", type=int, default=1000)
    parser.add_argument("--reader", choices=list(readers()), action="append")
    options = parser.parse_args()
    place = Path(tempfile.mkdtemp())
    print(place, flush=True)
    for one in options.reader or readers():
        print(one, options.examples, fuzz(one, options.examples, place), flush=True)
    shutil.rmtree(place)  # kept only after a failure
