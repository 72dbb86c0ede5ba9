"""Every reader's stated limits (docs/reference/limits.md): one sentence past them, at once."""

import io
import json
import os
import re
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from identifiability import Log, Robot
from identifiability.foundation.documents import MOST_BYTES as DOCUMENT
from identifiability.foundation.documents import MOST_KEYS, MOST_PARTS, MOST_TABLES, MOST_VALUES
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Renames
from identifiability.logs import source
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats import reader as sizes
from identifiability.logs.formats.reader import find_parts
from identifiability.logs.tables import LONGEST_CELL, open_parquet
from identifiability.regression.reduction import ladder_model, read_ladder
from identifiability.robot import markup as magnitudes
from identifiability.robot import markup as xml
from identifiability.robot.files import read_geometry
from identifiability.robot.table import write_table
from identifiability.workflows.predict import read_fit

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
COLUMNS = ("t", "shoulder.q", "elbow.q", "shoulder.tau", "elbow.tau")

#: Letters of the longest sentence that anybody reads.
READABLE = 900


@pytest.fixture
def refuses(tmp_path, at_once):
    """A function (read, name, content) -> None that asks for a sentence at once."""

    def check(read, name, content, sentence):
        path = tmp_path / name
        if callable(content):
            content(path)
        else:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        with at_once(), pytest.raises(IdentifiabilityError, match=sentence) as caught:
            read(path)
        assert len(str(caught.value)) <= READABLE

    return check


def sparse(path):
    """Make a file of 60 MB."""
    path.touch()
    os.truncate(path, 60_000_000)


def arm(inside="", head="", name="j", mass="1"):
    inertial = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>'
    body = f'<body name="b"><joint name="{name}"/>{inertial}{inside}</body>'
    return f"<mujoco>{head}<worldbody>{body}</worldbody></mujoco>"


def followers(count):
    """Return a joint that follows another one so many times."""
    body = '<body><joint name="k"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    told = "<equality>" + '<joint joint1="k" joint2="j"/>' * count + "</equality>"
    told += '<actuator><motor joint="j"/></actuator>'
    return arm(body).replace("</mujoco>", f"{told}</mujoco>")


def ring(count):
    """Return so many joints of which each follows the next one and the last the first."""
    weighs = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    joints = "".join(f'<body><joint name="follower{k}"/>{weighs}</body>' for k in range(count))
    ties = "".join(
        f'<joint joint1="follower{k}" joint2="follower{(k + 1) % count}"/>' for k in range(count)
    )
    told = f'<equality>{ties}</equality><actuator><motor joint="j"/></actuator>'
    return arm(joints).replace("</mujoco>", f"{told}</mujoco>")


def chain(count):
    """Write a URDF of so many joints."""
    moments = " ".join(f'{key}="{int(key[1] == key[2])}"' for key in MOMENTS)
    inertia = f'<inertial><mass value="1"/><inertia {moments}/></inertial>'
    links = "".join(f'<link name="l{k}">{inertia}</link>' for k in range(count + 1))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for k in range(count)
    )
    return f'<robot name="r">{links}{joints}</robot>'


def including(count, deep):
    """Write a file that includes so many, beside or in each other."""

    def write(path):
        names = [f"{k}.xml" for k in range(count)]
        for k, name in enumerate(names):
            inner = f'<include file="{k + 1}.xml"/>' if deep and k + 1 < count else ""
            path.with_name(name).write_text(f"<mujoco>{inner}</mujoco>")
        first = names[:1] if deep else names
        path.write_text(arm(head="".join(f'<include file="{n}"/>' for n in first)))

    return write


#: Attributes that each element of a kind would have.
DECLARED = " ".join(f'a{k} CDATA "1"' for k in range(500_000))

ROBOTS = {
    "elements": (
        arm("<site/>" * xml.MOST_ELEMENTS),
        "too large: robots of up to 200 bodies, 20000",
    ),
    "elements that never end": (b"<mujoco>" + b"<a>" * 2_000_000, "is too large"),
    "depth": (arm("<frame>" * 260 + "</frame>" * 260), "20000 elements and 250 levels"),
    "bodies": (arm("<body/>" * xml.MOST_BODIES), "is too large"),
    "bytes": (sparse, "larger than 50 MB"),
    "a tag that never ends": (b'<mujoco a="' + b"x" * 40_000_000, "it is not XML"),
    "declared attributes": (
        f"<!DOCTYPE mujoco [<!ATTLIST site {DECLARED}>]>" + arm("<site/>" * 10_000),
        "declares a document type, <!DOCTYPE",
    ),
    "equalities": (followers(xml.MOST_EQUALITIES + 1), "has 501 equalities that hold; robots of"),
    "includes": (including(xml.MOST_INCLUDES + 1, deep=False), "includes more than 100 files"),
    "room": (arm(head='<size nkey="2000000000"/>', mass="0"), "mass and inertia"),
    "copies by a sign": (arm('<replicate count="+99999999"><body/></replicate>'), "is too large"),
    "copies that are none": (arm('<replicate count="nan"><body/></replicate>'), "count"),
    "a name": (arm(name="x" * 501), "control characters or more than 500 letters"),
    "a name on two lines": (arm(name="a&#10;b"), "has control characters"),
    "mass": (arm(mass="1e16"), "is no number of a robot"),
    "gravity": (
        arm(head='<option gravity="0 0 1e16"/>'),
        "gravity, or the place of a joint, is no number",
    ),
    "advice": (ring(60), r"joints have no actuator .*--lock follower\d+ and \d+ more"),
}


XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
LAUGHS = "".join(
    f'<!ENTITY {b} "{10 * f"&{a};"}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)

#: Formats that are not read, and what of them would not end if they were.
NOT_READ = {
    "SDF": ("sdf", '<sdf version="1.9"><model/></sdf>', "its root element is <sdf>"),
    "SDF of many models": ("sdf", b"<sdf>" + b"<model/>" * 5_000_000, "is too large"),
    "SDF that includes": (
        "sdf",
        "<sdf><include><uri>file:///dev/zero</uri></include></sdf>",
        "sdf",
    ),
    "SDF that laughs": (
        "sdf",
        f'<!DOCTYPE x [<!ENTITY a "ha">{LAUGHS}]><sdf>&i;</sdf>',
        "no robot needs one",
    ),
    "xacro": ("xacro", XACRO.format('<xacro:include filename="/dev/zero"/>'), "not expanded"),
    "xacro in a ring": (
        "urdf",
        XACRO.format('<xacro:macro name="a"><xacro:a/></xacro:macro><xacro:a/>'),
        "not expanded",
    ),
    "xacro in itself": (
        "urdf",
        XACRO.format("<xacro:if>" * 300 + "</xacro:if>" * 300),
        "is too large|not expanded",
    ),
    "xacro of many": ("urdf", XACRO.format("<xacro:a/>" * 30_000), "is too large|not expanded"),
    "xacro that computes": ("urdf", XACRO.format('<link name="${9**9**9}"/>'), "not expanded"),
}


@pytest.mark.parametrize("what", NOT_READ)
def test_limits_of_formats_that_are_not_read(refuses, what):
    ending, content, sentence = NOT_READ[what]
    refuses(Robot.load, f"robot.{ending}", content, sentence)


@pytest.mark.parametrize("what", ROBOTS)
def test_limits_of_robot_files(refuses, what):
    content, sentence = ROBOTS[what]
    refuses(Robot.load, "robot.xml", content, sentence)


def test_what_is_read_takes_a_time_that_grows_like_the_file(tmp_path, at_once):
    path = tmp_path / "robot.xml"
    motors = "<actuator>" + '<motor joint="j"/>' * 6_000 + "</actuator>"
    path.write_text(arm().replace("</mujoco>", f"{motors}</mujoco>"))
    with at_once():
        assert Robot.load(path).joints == ("j",)


def test_limits_of_joints(refuses, tmp_path):
    most = magnitudes.MOST_JOINTS
    refuses(Robot.load, "robot.urdf", chain(most + 1), f"has {most + 1} degrees of freedom")
    whole = tmp_path / "whole.urdf"
    whole.write_text(chain(most))
    assert len(Robot.load(whole).joints) == most


def test_a_mesh_that_weighs_is_bounded(refuses):
    def write(path):
        with path.with_name("m.stl").open("wb") as file:
            file.truncate(xml.MOST_BYTES + 1)
        mesh = '<asset><mesh name="m" file="m.stl"/></asset>'
        path.write_text(arm('<body><joint/><geom type="mesh" mesh="m"/></body>', head=mesh))

    refuses(Robot.load, "robot.xml", write, "larger than 50 MB")


TOML = {
    "bytes": ("#" * (DOCUMENT["TOML"] + 1), "larger than 1 MB"),
    "depth of a key": (".".join("a" * 65) + " = 1", "names more than 64 tables"),
    "tables": ("[[loops]]\n" * (MOST_TABLES + 1), f"entries, more than {MOST_TABLES}"),
    "keys": (
        "[nominal]\n" + "\n".join(f"a{k} = 1" for k in range(MOST_KEYS + 1)),
        f"'nominal' has {MOST_KEYS + 1} entries, more than {MOST_KEYS}",
    ),
    "values": ("home = [" + "1," * (MOST_VALUES + 1) + "]", f"more than {MOST_VALUES}"),
    "coefficients": (
        f'[[couplings]]\njoint = "elbow"\npolynomial = {[1.0] * 51}',
        "polynomial': list should have at most 50 items",
    ),
    "a word of 900 kB": ("x" * 900_000, "is not valid TOML"),
    "a name": (f'name = "{"x" * 501}"', "at most 500 characters"),
    "a value": ('[nominal]\n"elbow.Fv" = 1e16', "less than or equal to"),
}


@pytest.mark.parametrize("what", TOML)
def test_limits_of_documents(refuses, what):
    content, sentence = TOML[what]
    refuses(lambda path: Robot.load("two-link", path), "sidecar.toml", content, sentence)


def test_limits_of_ladders_and_tables(refuses, tmp_path):
    many = "[[models]]\n" * (MOST_TABLES + 1)
    refuses(read_ladder, "ladder.toml", many, f"more than {MOST_TABLES}")
    link = f'[[links]]\nname = "a"\nalpha = "{"9" * 50_000}*"\n'
    unknown = f'[[models]]\nname = "{"m" * 60}"\neffects = ["{"x" * 60}"]'
    refuses(lambda p: ladder_model(read_ladder(p)), "ladder.toml", unknown, "There is no effect")
    table = f'convention = "standard"\n{link}'
    refuses(lambda p: write_table(p, tmp_path / "o.urdf"), "dh.toml", table, "is no part of pi")


def test_limits_of_results(refuses):
    def read(path):
        return read_fit(path, "two-link")

    refuses(read, "r.json", "[" + "[]," * MOST_PARTS + "1]", "more than 2000000 lists and keys")
    refuses(read, "r.json", sparse, "larger than 50 MB")
    refuses(read, "r.json", json.dumps({"a": 1})[:-1] + "[" * 3000, "is not valid JSON")


#: What is at its limit, and read.
AT = {
    "bodies": arm("<body/>" * (xml.MOST_BODIES - 1)),
    "depth": arm("<frame>" * (xml.DEEPEST - 3) + "</frame>" * (xml.DEEPEST - 3)),
    "room": arm(head='<size nkey="2000000000" nuser_geom="100"/>'),
    "idle": arm(head="<asset>" + "<material/>" * 2_000 + "</asset>"),
    "name": arm(name="x" * 500),
    "equalities": followers(xml.MOST_EQUALITIES),
}  # fmt: skip


@pytest.mark.parametrize("what", AT)
def test_what_is_at_its_limit_is_read(what, tmp_path, at_once):
    path = tmp_path / "robot.xml"
    path.write_text(AT[what])
    with at_once():
        assert len(Robot.load(path).joints) == 1


def test_every_limit_names_its_tests():
    tests = Path(__file__).parent
    page = tests.parents[1] / "docs" / "reference" / "limits.md"
    rows = [x for x in page.read_text(encoding="utf-8").splitlines() if x.startswith("| ")][2:]
    assert len(rows) > 25
    for row in rows:
        *_, named = row.strip("| ").split("|")
        words = re.findall(r"`(\w+(?:\.py)?)`", named)
        names = [word for word in words if not word.endswith(".py")]
        files = [word for word in words if word.endswith(".py")] or [Path(__file__).name]
        text = "".join((tests / file).read_text(encoding="utf-8") for file in files)
        assert names, row
        assert not [name for name in names if f"\ndef {name}(" not in text], row


@pytest.mark.parametrize("rule", ["(a|aa)+x", "(.*)(.*)(.*)(.*)x", "(a+){9}"])
def test_rules_for_names_end(rule):
    with pytest.raises(ValueError, match="may be looked for without end"):
        Renames.of({rule: "x"})
    assert Renames.of({r"fer_(.*)_joint(\d+)": r"\1_\2"}).apply("fer_a_joint1") == "a_1"
    assert Renames.of({".*.*.*x": "y"}).apply("x" * 201) == "x" * 201


def table(path):
    frame = pd.DataFrame({c: np.zeros(100) for c in COLUMNS})
    frame.assign(x="a" * (2 * LONGEST_CELL)).to_parquet(path, use_dictionary=False)


def wide(path):
    pd.DataFrame({f"x{k}": [0.0] for k in range(501)}).to_parquet(path)


def zeros(count, kind="<f8"):
    """Write an array of so many zeros in few bytes."""

    def write(path):
        head = io.BytesIO()
        declared = {"descr": kind, "fortran_order": False, "shape": (count,)}
        np.lib.format.write_array_header_1_0(head, declared)
        size = count * np.dtype(kind).itemsize
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("t.npy", head.getvalue() + bytes(size))

    return write


def parts(path):
    with zipfile.ZipFile(path, "w") as archive:
        for k in range(sizes.MOST_PARTS + 1):
            archive.writestr(f"a{k}.npy", b"")


LOGS = {
    "a line": ("run.csv", b"t,q," * 100_000, "no end of a line in its first 262 kB"),
    "columns of a CSV": (
        "run.csv",
        ",".join(f"x{k}" for k in range(501)) + "\n" + "0," * 500 + "0\n",
        "501 columns; logs of up to 500",
    ),
    "columns of a Parquet file": ("run.parquet", wide, "501 columns; logs of up to 500"),
    "cells": ("run.parquet", table, "the cells of 'x' are longer than 4096 bytes"),
    "bytes of arrays": ("run.npz", zeros(600_000), "unpacks to more than 4 MB"),
    "values of arrays": ("run.npz", zeros(3_100_000, "|i1"), "holds 3100000 values; up to"),
    "parts": ("run.npz", parts, "has 1001 parts"),
}


def test_the_limits_of_arrays_are_those_that_are_stated():
    assert (sizes.MOST_BYTES, sizes.MOST_VALUES) == (250_000_000, 30_000_000)
    assert sizes.MOST_COLUMNS == 5_000


@pytest.mark.parametrize("what", LOGS)
def test_limits_of_logs(refuses, what, monkeypatch):
    monkeypatch.setattr(sizes, "MOST_BYTES", 4_000_000)
    monkeypatch.setattr(sizes, "MOST_VALUES", 3_000_000)
    monkeypatch.setattr(sizes, "MOST_COLUMNS", 500)
    name, content, sentence = LOGS[what]
    refuses(Log.read, name, content, sentence)


def test_a_header_of_many_long_names_is_read(tmp_path, at_once):
    """No separator but its own parts a line of 140 kB into fields of a length that is read."""
    extra = [f"{'x' * 90}{k}" for k in range(1500)]
    rows = [",".join(["0"] * 1505).replace("0", f"{k / 8}", 1) for k in range(40)]
    path = tmp_path / "run.csv"
    path.write_text("\n".join([",".join([*COLUMNS, *extra]), *rows, ""]))
    with at_once():
        assert Log.read(path).q.shape == (40, 2)


def test_small_groups_of_parquet_are_read_together(tmp_path):
    path = tmp_path / "run.parquet"
    t = np.arange(1000) / 64
    frame = pd.DataFrame({c: t * k for k, c in enumerate(COLUMNS, 1)})
    frame.to_parquet(path, row_group_size=1)
    assert open_parquet(path).pieces == ((0, 0), (1000, 1000))
    np.testing.assert_array_equal(Log.read(path).tau, frame[list(COLUMNS[3:])])


def sheet(inside, part="xl/worksheets/sheet1.xml"):
    def write(path):
        pd.DataFrame({"t": [0.0]}).to_excel(path, index=False)
        kept = zipfile.ZipFile(path)
        whole = {i.filename: kept.read(i) for i in kept.infolist()} | {part: inside}
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in whole.items():
                archive.writestr(name, content)

    return write


SHEETS = {
    "bytes": (b" " * (sizes.MOST_SHEET_BYTES + 1), "unpacks to more than 50 MB"),
    "a cell far right": (b'<c r="XFD1"/>', "16384 columns"),
    "a cell far down": (b"<c r='CV999999'/>", "values; up to"),
}


@pytest.mark.parametrize("what", SHEETS)
def test_limits_of_sheets(refuses, what):
    pytest.importorskip("openpyxl")
    content, sentence = SHEETS[what]
    refuses(Log.read, "run.xlsx", sheet(content), sentence)


def dataset(info, **columns):
    """Write a LeRobot folder."""

    def write(path):
        (path / "meta").mkdir(parents=True)
        (path / "data").mkdir()
        (path / "meta" / "info.json").write_text(info)
        pd.DataFrame({"timestamp": [0.0], "episode_index": [0], **columns}).to_parquet(
            path / "data" / "a.parquet"
        )

    return write


KNOWN = '"codebase_version": "v2.1", "total_episodes": '
DATASETS = {
    "episodes": (f"{{{KNOWN} 100000000}}", "has 100000000 episodes, each a log, and up to 1000"),
    "episodes without end": (f"{{{KNOWN} 1e400}}", "holds no episode"),
    "bytes": (f'{{{KNOWN} 1, "x": "{"x" * sizes.MOST_DESCRIBED}"}}', "is larger than 2 MB"),
    "depth": ("[" * 100_000, "cannot be read as JSON"),
    "values": (f"{{{KNOWN} 1}}", r"holds 40\d{3} values; up to"),
}


@pytest.mark.parametrize("what", DATASETS)
def test_limits_of_datasets(refuses, what, monkeypatch):
    monkeypatch.setattr(sizes, "MOST_VALUES", 30_000)
    info, sentence = DATASETS[what]
    content = dataset(info, **{"observation.state": [[0.1] * 40_000]})
    refuses(lambda path: [Log.read(p) for p in find_parts(path)], "data", content, sentence)


@pytest.mark.parametrize("name", ["robot.xml", "sidecar.toml", "run.csv", "run.parquet"])
def test_a_pipe_is_not_waited_for(refuses, name):
    reads = {".xml": Robot.load, ".toml": lambda path: Robot.load("two-link", path)}
    read = reads.get(f".{name.partition('.')[2]}", Log.read)
    refuses(read, name, os.mkfifo, r"no file|no log file|no robot file")


def test_what_is_no_log_is_named(tmp_path, refuses):
    for ending, kind in (("h5", "HDF5"), ("jsonl", "JSON"), ("yaml", "YAML"), ("xml", "XML")):
        refuses(Log.read, f"run.{ending}", "t: 1\n", f"is {kind}; write its")
    refuses(Log.read, "run.ulg", b"ULog\0", "holds no text, .* folders of LeRobot are read")
    refuses(Log.read, "folder", lambda path: path.mkdir(), "is a folder, and none of a bag")


def test_a_header_of_a_pipe_is_left_to_its_reader(tmp_path):
    os.mkfifo(tmp_path / "run.csv")
    source.check_header(tmp_path / "run.csv", Conventions())


def test_a_ring_of_links_is_one_sentence(tmp_path):
    ring = tmp_path / "robot.xml"
    ring.symlink_to(tmp_path / "other")
    (tmp_path / "other").symlink_to(ring)
    with pytest.raises(IdentifiabilityError, match="There is no robot file"):
        Robot.load(ring)


def test_a_line_of_a_table_has_an_end(refuses):
    rows = ",".join(COLUMNS) + "\n" + "".join(f"{k / 10},0,0,0,0\n" for k in range(30))
    refuses(Log.read, "run.csv", rows + "1," * 9_000_000, "more fields than its header|cannot be")


def test_entities_of_other_files_are_not_fetched(refuses, tmp_path):
    (tmp_path / "secret").write_text("1")
    entity = f'<!DOCTYPE mujoco [<!ENTITY x SYSTEM "{(tmp_path / "secret").as_uri()}">]>'
    refuses(Robot.load, "robot.xml", entity + arm(mass="&x;"), "no robot needs one")


def test_as_many_values_as_are_held():
    sizes.check_values("bag", sizes.MOST_VALUES)
    with pytest.raises(IdentifiabilityError, match="bag holds 30000001 values"):
        sizes.check_values("bag", sizes.MOST_VALUES + 1)


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_a_pipe_where_a_shape_should_be_is_not_waited_for(refuses, ending):
    def write(path):
        os.mkfifo(path.with_name("m.stl"))
        mesh = '<asset><mesh name="m" file="m.stl"/></asset>'
        shape = '<collision><geometry><mesh filename="m.stl"/></geometry></collision></link>'
        mjcf = arm('<geom type="mesh" mesh="m"/>', head=mesh)
        path.write_text(mjcf if ending == "xml" else chain(2).replace("</link>", shape, 1))

    refuses(lambda p: read_geometry(Robot.load(p)), f"robot.{ending}", write, "it is no file")
