"""Every reader's stated limits (docs/reference/limits.md): one sentence past them, at once."""

import os

import pytest

from identifiability import IdentifiabilityError, Log, Robot
from identifiability.foundation.documents import MOST_BYTES as DOCUMENT
from identifiability.foundation.names import Renames
from identifiability.robot import assembly
from identifiability.robot import locate as xml

from ..robot_files.made_robots import INERTIAL, turning

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


def ring():
    """Return 60 joints of which each follows the next one and the last the first."""
    weighs = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    joints = "".join(f'<body><joint name="follower{k}"/>{weighs}</body>' for k in range(60))
    ties = "".join(
        f'<joint joint1="follower{k}" joint2="follower{(k + 1) % 60}"/>' for k in range(60)
    )
    told = f'<equality>{ties}</equality><actuator><motor joint="j"/></actuator>'
    return turning(joints, tail=told)


def chain(count):
    """Write a URDF of so many joints."""
    links = "".join(f'<link name="l{k}">{INERTIAL}</link>' for k in range(count + 1))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/></joint>'
        for k in range(count)
    )
    return f'<robot name="r">{links}{joints}</robot>'


def including(path):
    """Write a file that includes one more than it may."""
    names = [f"{k}.xml" for k in range(xml.MOST_INCLUDES + 1)]
    for name in names:
        path.with_name(name).write_text("<mujoco/>")
    path.write_text(turning(head="".join(f'<include file="{name}"/>' for name in names)))


ROBOTS = {
    "bytes": (sparse, "larger than 10 MB"),
    "includes": (including, "includes more than 100 files"),
    "room": (turning(head='<size nkey="2000000000"/>', mass="0"), "mass and inertia"),
    "copies by a sign": (
        turning('<replicate count="+99999999"><body/></replicate>'),
        "is too large",
    ),
    "gravity": (
        turning(head='<option gravity="0 0 1e16"/>'),
        "gravity, the place of a joint or site, .* is infinite",
    ),
    "advice": (ring(), r"joints have no actuator .* and \d+ more\) .* must be locked"),
}


XACRO = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
#: Formats that are not read, and what of them would not end if they were.
NOT_READ = {
    "xacro in a ring": (
        XACRO.format('<xacro:macro name="a"><xacro:a/></xacro:macro><xacro:a/>'),
        "not expanded",
    ),
    "xacro that computes": (XACRO.format('<link name="${9**9**9}"/>'), "not expanded"),
}


@pytest.mark.parametrize("what", ROBOTS | NOT_READ)
def test_limits_of_robot_files_and_of_formats_that_are_not_read(refuses, what):
    ending = "urdf" if what in NOT_READ else "xml"
    refuses(Robot.load, f"robot.{ending}", *(ROBOTS | NOT_READ)[what])


def test_what_is_read_takes_a_time_that_grows_like_the_file(load_text, at_once):
    motors = "<actuator>" + '<motor joint="j"/>' * 6_000 + "</actuator>"
    with at_once():
        assert load_text(turning(tail=motors)).joints == ("j",)


def test_limits_of_joints(refuses, load_text):
    most = assembly.MOST_JOINTS
    refuses(Robot.load, "robot.urdf", chain(most + 1), f"has {most + 1} degrees of freedom")
    assert len(load_text(chain(most), "urdf").joints) == most


def test_a_mesh_that_weighs_is_bounded(refuses):
    def write(path):
        with path.with_name("m.stl").open("wb") as file:
            file.truncate(xml.MOST_BYTES + 1)
        mesh = '<asset><mesh name="m" file="m.stl"/></asset>'
        path.write_text(turning('<body><joint/><geom type="mesh" mesh="m"/></body>', head=mesh))

    refuses(Robot.load, "robot.xml", write, "larger than 50 MB")


TOML = {
    "bytes": ("#" * (DOCUMENT["TOML"] + 1), "larger than 1 MB"),
    "a name": (f'locked = ["{"n" * 501}"]', "'locked.0': string should have at most 500"),
    "depth of a key": (".".join("a" * 65) + " = 1", "names more than 64 tables"),
}


@pytest.mark.parametrize("what", TOML)
def test_limits_of_documents(refuses, what):
    content, sentence = TOML[what]
    refuses(lambda path: Robot.load("two-link", path), "sidecar.toml", content, sentence)


#: What is at its limit, and read.
AT = {
    "bodies": turning("<body/>" * (xml.MOST_BODIES - 1)),
    "room": turning(head='<size nkey="2000000000" nuser_geom="100"/>'),
}


@pytest.mark.parametrize("what", AT)
def test_what_is_at_its_limit_is_read(what, load_text, at_once):
    with at_once():
        assert len(load_text(AT[what]).joints) == 1


@pytest.mark.parametrize("rule", ["(a|aa)+x", "(.*)(.*)(.*)(.*)x", "(a+){9}"])
def test_rules_for_names_end(rule):
    with pytest.raises(ValueError, match="may be looked for without end"):
        Renames.of({rule: "x"})
    assert Renames.of({r"fer_(.*)_joint(\d+)": r"\1_\2"}).apply("fer_a_joint1") == "a_1"
    assert Renames.of({".*.*.*x": "y"}).apply("x" * 201) == "x" * 201


@pytest.mark.parametrize("name", ["robot.xml", "sidecar.toml", "run.csv", "run.parquet"])
def test_a_pipe_is_not_waited_for(refuses, name):
    reads = {".xml": Robot.load, ".toml": lambda path: Robot.load("two-link", path)}
    read = reads.get(f".{name.partition('.')[2]}", Log.read)
    refuses(read, name, os.mkfifo, r"no file|no log file|no robot file")
