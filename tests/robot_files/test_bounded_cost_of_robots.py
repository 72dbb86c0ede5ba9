"""Small robot files cost little: each is refused in one sentence, or read, within its limits.

Every file is read in a process of its own, whose memory the system limits. The limit on time is far
above what any of them takes (below 2 s on a machine with nothing else to do).
"""

import json
import sys

import pytest

from .made_robots import INERTIAL, turning

#: Memory [bytes] and processor time [s] of a process that has imported the library.
MEMORY, SECONDS = 500_000_000, 20

#: Letters of the longest sentence that anybody reads.
READABLE = 900

#: Imports, and reads each file in a fork with limits on what it takes; prints sentences by name.
READ = """
import json, os, resource, sys
from pathlib import Path
from identifiability import Robot
from identifiability.foundation.errors import IdentifiabilityError

def read(path):
    pages = int(open("/proc/self/statm").read().split()[0])
    limit = pages * resource.getpagesize() + int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[3]),) * 2)
    try:
        return "" if Robot.load(path).joints else "no joints"
    except IdentifiabilityError as error:
        return str(error)

Robot.load("two-link"), Robot.load("six-dof-arm")
said = {}
for path in sorted(Path(sys.argv[1]).glob("*/robot.*")):
    source, sink = os.pipe()
    if not (child := os.fork()):
        os.write(sink, read(path).encode())
        os._exit(0)
    os.close(sink)
    _, status = os.waitpid(child, 0)
    sentence = os.read(source, 10_000).decode()
    said[path.parent.name] = f"ended by {status}" if status else sentence
    os.close(source)
print(json.dumps(said))
"""

ATTRIBUTES = " ".join(f'a{k}="1"' for k in range(200_000))
NAME = "n" * 4_000_000
ASKS = '<asset><mesh name="m" builtin="{}"/></asset>'
ATTRIBUTED, LONG = "more than 100 attributes", "a name or value of more than 500 letters"
COPIES, LEVELS = "with a number larger than", "more than 250 levels deep"


def urdf(inside="", extra="", link="", joint="j", body="arm"):
    """Return a URDF of one link that turns."""
    return (
        f'<robot name="r"><link name="base"/><link name="{body}" {link}>{INERTIAL}{inside}'
        f'</link><joint name="{joint}" type="continuous"><parent link="base"/>'
        f'<child link="{body}"/><axis xyz="0 1 0"/></joint>{extra}</robot>'
    )


def copies(count, inside="<body><joint/></body>"):
    return f'<replicate count="{count}">{inside}</replicate>'


def assets(kind, count, more=""):
    return "<asset>" + "".join(f'<{kind} name="a{k}" {more}/>' for k in range(count)) + "</asset>"


#: The ending of a file, its content, and what its sentence says; nothing where it is read.
FILES = {
    "attributes of a link": (".urdf", urdf(link=ATTRIBUTES), ATTRIBUTED),
    "attributes of a look": (".urdf", urdf(f"<visual {ATTRIBUTES}/>"), ATTRIBUTED),
    "attributes of a body": (".xml", turning(f"<body {ATTRIBUTES}/>"), ATTRIBUTED),
    "copies beside blanks": (".xml", turning(copies(" 100000 ")), COPIES),
    "copies after a tab": (".xml", turning(copies("&#9;100000")), COPIES),
    "copies of nothing": (".xml", turning(copies("2000000000", "")), COPIES),
    "copies with many digits": (".xml", turning(copies("9" * 5000)), LONG),
    "copies of copies": (
        ".xml",
        turning(copies(" 50", copies("50 ", copies(" 50 ")))),
        "has 125001 bodies that move, with fixed joints merged; robots of up to 200 are read",
    ),
    "copies of sites": (".xml", turning(copies(" 20000", "<site/><site/>")), "with copies counted"),
    "vertices of a mesh": (".xml", turning(head=ASKS.format('cone" params="9000000 1')), COPIES),
    "cloth": (
        ".xml",
        turning('<flexcomp name="f" type="box" count="500 500 500" spacing="1 1 1" radius=".01"/>'),
        "with copies counted",
    ),
    "rows of a height field": (
        ".xml",
        turning(head=assets("hfield", 1, 'nrow="50000" ncol="50000" size="1 1 1 1"')),
        COPIES,
    ),
    "samples of a delay": (
        ".xml",
        turning(tail='<actuator><motor joint="j" nsample="2000000000" delay=".1"/></actuator>'),
        COPIES,
    ),
    "activations": (
        ".xml",
        turning(tail='<actuator><general joint="j" dyntype="user" actdim="900000000"/></actuator>'),
        COPIES,
    ),
    "many materials": (".xml", turning(head=assets("material", 9000)), "9000 parts of <asset>"),
    "many exclusions": (
        ".xml",
        turning(tail="<contact>" + '<exclude body1="b" body2="world"/>' * 9000 + "</contact>"),
        "9000 parts of <contact>",
    ),
    "user data": (
        ".xml",
        turning(head='<size nuser_body="2000000000" nuser_jnt="2000000000"/>'),
        "",
    ),
    "memory": (".xml", turning(head='<size memory="100G"/>'), ""),
    "name of a link": (".urdf", urdf(body=NAME), LONG),
    "name of a joint": (".urdf", urdf(joint=NAME), LONG),
    "name of blanks": (".urdf", urdf(body="n " * 2_000_000), LONG),
    "name of an element": (".urdf", urdf(f"<{NAME}/>"), LONG),
    "name of an attribute": (".xml", turning(f'<body {NAME}="1"/>'), LONG),
    "number of many digits": (".urdf", urdf().replace('value="1"', f'value="{"1" * 900}"'), LONG),
    "vector of many numbers": (".urdf", urdf().replace("0 1 0", "0 " * 2_000_000), LONG),
    "text": (".urdf", urdf("&amp;" * 1_800_000), ""),
    "deep": (".urdf", urdf("<a>" * 15_000 + "</a>" * 15_000), LEVELS),
    "many elements": (".urdf", urdf("<visual/>" * 900_000), "more than 20000 elements"),
    "many frames on fixed joints": (
        ".urdf",
        urdf(
            extra="".join(
                f'<link name="x{k}"/><joint name="y{k}" type="fixed"><parent link="arm"/>'
                f'<child link="x{k}"/></joint>'
                for k in range(3900)
            )
        ),
        "",
    ),
    "near matches": (
        ".urdf",
        urdf(
            '<a name="{}"/>'.format("y" * 480),
            "".join(
                f'<link name="x{k}"/><joint name="{"y" * 480}{k}" type="fixed">'
                f'<parent link="arm"/><child link="x{k}"/></joint>'
                for k in range(2000)
            ),
        ).replace("<axis", f'<mimic joint="{"y" * 479}zz"/><axis', 1),
        "did you mean",
    ),
    "document type in UTF-16": (
        ".xml",
        f'<?xml version="1.0" encoding="utf-16"?><!DOCTYPE m [<!ENTITY a "x">]>{turning()}',
        "declares a document type",
    ),
}


@pytest.fixture(scope="module")
def sentences(tmp_path_factory, process):
    """The sentence of every file; empty where it was read."""
    folder = tmp_path_factory.mktemp("files")
    for number, (ending, content, _) in enumerate(FILES.values()):
        path = folder / f"{number}" / f"robot{ending}"
        path.parent.mkdir()
        path.write_text(content, encoding="utf-16" if "utf-16" in content[:60] else "utf-8")
    write_including(folder / "include" / "robot.xml")
    write_attaching(folder / "attach" / "robot.xml")
    words = [sys.executable, "-c", READ, str(folder), str(MEMORY), str(SECONDS)]
    done = process(words)
    assert done.returncode == 0, done.stderr[-500:]
    return json.loads(done.stdout)


def write_leaf(path):
    """Write a file of some thousand elements beside a path."""
    path.parent.mkdir()
    leaf = path.with_name("leaf.xml")
    leaf.write_text(turning("<site/>" * 3000, joint="k"))
    return leaf


def write_including(path):
    """Write a file that includes another one many times."""
    leaf = write_leaf(path)
    path.write_text(turning(head=f'<include file="{leaf.name}"/>' * 90))


def write_attaching(path):
    """Write a file that attaches another one many times."""
    asset = f'<asset><model name="m" file="{write_leaf(path)}"/></asset>'
    places = "".join(f'<attach model="m" body="b" prefix="x{k}"/>' for k in range(90))
    path.write_text(turning(places, head=asset))


ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory so")


@ON_LINUX
@pytest.mark.parametrize("what", FILES)
def test_a_robot_file_costs_little(what, sentences):
    said = sentences[str([*FILES].index(what))]
    sentence = FILES[what][2]
    assert sentence in said if sentence else not said
    assert len(said) <= READABLE


@ON_LINUX
@pytest.mark.parametrize("word", ["include", "attach"])
def test_files_that_others_include_or_attach_count(word, sentences):
    assert "is too large: it has more than 20000 elements" in sentences[word]
