"""What `inertial`, `geom` and `site` can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, GEOM, arm, solid

_MESH = '<asset><mesh name="wedge" {} vertex="0 0 0 0.3 0 0 0 0.2 0 0 0 0.1 0.3 0.2 0.05"/></asset>'
_TOOL = '<geom type="mesh" mesh="wedge" pos="0.02 0.05 0.01" {}/>'


def _shape(kind: str, size: str, more: str = "") -> Entry:
    geom = f'<geom type="{kind}" size="{size}" pos="0.1 0.02 0" euler="20 40 60" {more}/>'
    return Entry(f"geom {kind}", arm(in_fore=f"[[{geom}||{FORE}]]"))


INERTIAL = (
    Entry(
        "inertial pos",
        arm(
            in_fore='<inertial pos="[[0.1 0.2 -0.3||0 0 0]]" mass="2" diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial quat",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" [[quat="1 2 3 4"]] '
            'diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial euler",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" [[euler="20 50 70"]] '
            'diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial axisangle not of unit length",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" [[axisangle="1 1 3 70"]] '
            'diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial xyaxes",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" [[xyaxes="1 1 0 -1 2 1"]] '
            'diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial zaxis",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" [[zaxis="1 1 0"]] '
            'diaginertia="0.1 0.2 0.15"/>'
        ),
    ),
    Entry(
        "inertial fullinertia",
        arm(
            in_fore='<inertial pos="0.1 0 0" mass="2" fullinertia="0.1 0.2 0.15 '
            '[[0.03 -0.02 0.04||0 0 0]]"/>'
        ),
    ),
    Entry(
        "inertial without inertia",
        arm(in_fore='<inertial pos="0.1 0 0" mass="2" [[||diaginertia="0.1 0.2 0.15"]]/>'),
        unreadable=True,
        refusal="inertia",
    ),
    Entry(
        "inertial of a static body",
        arm(in_base='[[<inertial pos="1 0 0" mass="5" diaginertia="1 1 1"/>]]'),
        inert=True,
    ),
    Entry("inertial beside geoms", arm(in_fore=FORE + f"[[{GEOM}]]"), inert=True),
    Entry(
        "inertial of the parts of a rigid body",
        arm(
            in_fore=FORE
            + '<body name="bracket" pos="0 0.1 0.2"><inertial pos="0.1 0 0" mass="[[1||2]]"'
            ' euler="0 40 0" diaginertia="0.01 0.02 0.015"/></body>'
        ),
    ),
)


GEOMS = (
    _shape("sphere", "0.1"),
    _shape("capsule", "0.05 0.2"),
    _shape("ellipsoid", "0.05 0.1 0.2"),
    _shape("cylinder", "0.05 0.2"),
    _shape("box", "0.05 0.1 0.2"),
    Entry("geom mass", solid(in_fore=GEOM.replace("<geom", '<geom [[mass="4"]]'))),
    Entry("geom density", solid(in_fore=GEOM.replace("<geom", '<geom [[density="400"]]'))),
    Entry(
        "geom shellinertia", solid(in_fore=GEOM.replace("<geom", '<geom [[shellinertia="true"]]'))
    ),
    Entry(
        "geom fromto",
        arm(
            in_fore='<geom type="capsule" size="0.04" '
            '[[fromto="0 0 0.1 0.3 0.1 -0.1"||fromto="0 0 0 0.3 0 0"]]/>'
        ),
    ),
    Entry("geom quat", solid(in_fore=GEOM.replace("<geom", '<geom [[quat="1 0.5 -0.3 2"]]'))),
    Entry(
        "geom axisangle not of unit length",
        solid(in_fore=GEOM.replace("<geom", '<geom [[axisangle="3 0 4 40"]]')),
    ),
    Entry("geom group", solid(in_fore=GEOM.replace("<geom", '<geom [[group="4"]]')), inert=True),
    Entry(
        "geom friction and contact",
        solid(in_fore=GEOM.replace("<geom", '<geom [[friction="2" condim="6" margin="0.1"]]')),
        inert=True,
    ),
    Entry("geom without mass", arm(in_fore=GEOM + '<geom size="0.2" [[mass="0"]]/>')),
    Entry("geoms: several in one body", arm(in_fore=f'{GEOM}[[<geom size="0.1" pos="0 0.2 0"/>]]')),
    Entry(
        "geom fluidshape",
        solid(
            '<option density="1000"/>',
            in_fore=GEOM.replace("<geom", '<geom [[fluidshape="ellipsoid"]]'),
        ),
        refusal="density",
    ),
    Entry("geom of a mesh", arm(_MESH.format(""), in_fore=f"[[{_TOOL.format('')}||{FORE}]]")),
    Entry(
        "geom of a scaled mesh", arm(_MESH.format('[[scale="2 1 -3"]]'), in_fore=_TOOL.format(""))
    ),
    Entry(
        "geom of a mesh with inertia of its shell",
        arm(_MESH.format('[[inertia="shell"]]'), in_fore=_TOOL.format("")),
    ),
    Entry(
        "geom of a mesh with a reference pose",
        arm(_MESH.format('[[refpos="0.1 0 0" refquat="1 0 1 0"]]'), in_fore=_TOOL.format("")),
    ),
    Entry(
        "geom fitted to a mesh",
        arm(
            _MESH.format(""),
            in_fore=_TOOL.format("").replace('type="mesh"', 'type="[[box||mesh]]"'),
        ),
    ),
    Entry(
        "geom of a mesh in a file",
        arm(
            '<compiler meshdir="[[.||]]"/><asset><mesh name="wedge" file="wedge.obj"/></asset>',
            in_fore=_TOOL.format(""),
        ),
        inert=True,
        files={
            "wedge.obj": "v 0 0 0\nv 0.3 0 0\nv 0 0.2 0\nv 0 0 0.1\n"
            "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
        },
    ),
    Entry("geom zaxis", solid(in_fore=GEOM.replace("<geom", '<geom [[zaxis="1 1 0.2"]]'))),
    Entry("geom xyaxes", solid(in_fore=GEOM.replace("<geom", '<geom [[xyaxes="1 1 0 -1 1 1"]]'))),
    Entry(
        "geom fluidcoef",
        solid(
            '<option density="1000"/>',
            in_fore=GEOM.replace("<geom", '<geom fluidshape="ellipsoid" [[fluidcoef="1 1 1 1 1"]]'),
        ),
        refusal="density",
    ),
    Entry(
        "geom fluidshape without a fluid",
        solid(in_fore=GEOM.replace("<geom", '<geom [[fluidshape="ellipsoid"]]')),
        inert=True,
    ),
    Entry(
        "geom fitted to a mesh and scaled",
        arm(
            _MESH.format(""),
            in_fore=_TOOL.format('[[fitscale="1.3"]]').replace('type="mesh"', 'type="box"'),
        ),
    ),
    Entry(
        "geom of a height field",
        arm(
            '<asset><hfield name="hill" nrow="2" ncol="2" size="1 1 1 0.1"/></asset>',
            world='[[<geom type="hfield" hfield="hill"/>]]',
        ),
        inert=True,
    ),
    Entry("site", arm(in_fore=FORE + '[[<site name="tool" pos="0 0 1" size="0.1"/>]]'), inert=True),
)

ALL = (
    *INERTIAL,
    *GEOMS,
)
