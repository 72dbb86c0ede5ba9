"""What `default`, `include`, `frame`, `replicate` and their like can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, GEOM, MOTORS, arm, four_bar, solid

DEFAULT = (
    Entry(
        "default joint",
        arm('[[<default><joint damping="2" armature="0.1" frictionloss="0.7"/></default>]]'),
    ),
    Entry(
        "default joint axis and kind",
        arm(
            '<default><joint [[type="slide" axis="0.3 -0.4 1"]]/></default>', shoulder="", elbow=""
        ),
    ),
    Entry(
        "default class of a joint",
        arm(
            '<default><default class="stiff"><joint damping="5" armature="0.2"/></default>'
            "</default>",
            elbow='axis="0 1 0" [[class="stiff"]]',
        ),
    ),
    Entry(
        "default class within a class",
        arm(
            '<default><default class="one"><joint armature="0.3"/><default class="two">'
            '<joint damping="5"/></default></default></default>',
            elbow='axis="0 1 0" class="[[two||one]]"',
        ),
    ),
    Entry(
        "default childclass of a body",
        arm(
            '<default><default class="all"><joint damping="5"/></default></default>',
            fore='pos="0.4 0.05 -0.1" [[childclass="all"]]',
        ),
    ),
    Entry(
        "default childclass nearer to the joint",
        arm(
            '<default><default class="all"><joint damping="5"/></default>'
            '<default class="few"><joint damping="1" armature="0.2"/></default></default>',
            upper='pos="0.1 -0.2 0.4" childclass="all"',
            fore='pos="0.4 0.05 -0.1" [[childclass="few"]]',
        ),
    ),
    Entry("default geom density", solid('[[<default><geom density="2700"/></default>]]')),
    Entry("default geom mass", solid('[[<default><geom mass="2"/></default>]]')),
    Entry(
        "default class of a geom",
        solid(
            '<default><default class="heavy"><geom density="7800" type="sphere"/></default>'
            "</default>",
            in_fore='<geom [[class="heavy"]] size="0.1 0.1 0.1" pos="0.1 0 0"/>',
        ),
    ),
    Entry(
        "default site position",
        four_bar(
            '<default><site pos="[[0.1||0.12]] 0 0"/></default>',
            in_base='<body name="post" pos="0.6 0 0"><site name="pin"/></body>',
        ),
        spread=0.3,
    ),
    Entry(
        "default equality switched off",
        arm(
            '<default>[[<equality active="false"/>]]</default>',
            '<equality><joint joint1="elbow" joint2="shoulder"/></equality><actuator>'
            '<motor joint="shoulder"/>[[<motor joint="elbow"/>]]<motor joint="wrist"/></actuator>',
        ),
    ),
    Entry(
        "default tendon stiffness",
        arm(
            '<default>[[<tendon stiffness="9"/>]]</default>',
            '<tendon><fixed><joint joint="elbow" coef="0.5"/></fixed></tendon>',
        ),
    ),
    Entry(
        "default motor gear", arm('<default>[[<motor gear="50"/>]]</default>', MOTORS), inert=True
    ),
    Entry(
        "default that is named main",
        arm('<default class="main"><joint [[damping="3"]]/></default>'),
    ),
)


MACROS = (
    Entry(
        "include of a body",
        arm(in_fore=f'[[<include file="part.xml"/>||{FORE}]]'),
        files={"part.xml": f"<mujocoinclude>{GEOM}</mujocoinclude>"},
    ),
    Entry(
        "include of defaults",
        arm('[[<include file="part.xml"/>]]'),
        files={"part.xml": '<mujoco><default><joint armature="0.4"/></default></mujoco>'},
    ),
    Entry(
        "frame",
        arm(
            in_fore=FORE + '[[<frame pos="0.1 0 0" euler="0 40 0">]]<body name="extra" '
            f'pos="0 0.2 0"><joint name="extra" axis="1 0 0"/>{GEOM}</body>'
            "[[</frame>]]"
        ),
    ),
    Entry(
        "frame with a childclass",
        arm(
            '<default><default class="all"><joint armature="0.3"/></default></default>',
            in_fore=FORE + '<frame [[childclass="all"]]><body name="extra" pos="0 0.2 0">'
            f'<joint name="extra" axis="1 0 0"/>{GEOM}</body></frame>',
        ),
    ),
    Entry(
        "frame in a frame",
        arm(
            in_fore='<frame pos="0.1 0 0" [[axisangle="0 1 1 30"]]><frame '
            f'quat="1 0 1 0">{GEOM}</frame></frame>'
        ),
    ),
    Entry(
        "replicate of geoms",
        arm(
            in_fore='[[<replicate count="3" offset="0 0.1 0" '
            f'euler="0 0 30">]]{GEOM}[[</replicate>]]'
        ),
    ),
    Entry(
        "replicate of bodies",
        arm(
            in_fore=FORE + '<replicate count="2" offset="0 0.2 0">'
            '<body name="finger"><joint name="finger"/>'
            f"{GEOM}</body></replicate>"
        ),
    ),
    Entry(
        "attach",
        arm(
            '<asset><model name="tool" file="tool.xml"/></asset>',
            in_fore=FORE + '[[<attach model="tool" body="tool" prefix="t_"/>]]',
        ),
        files={
            "tool.xml": f'<mujoco><worldbody><body name="tool" pos="0 0.1 0">{GEOM}</body>'
            "</worldbody></mujoco>"
        },
        refusal="attach",
    ),
    Entry(
        "flexcomp",
        arm(
            world='[[<flexcomp name="cloth" type="grid" count="2 2 1" spacing='
            '"0.1 0.1 0.1" dim="2" radius="0.01" mass="0.2"/>]]'
        ),
        refusal="flex",
    ),
    Entry(
        "sections that stand twice",
        arm(
            '<option timestep="0.01"/><default><joint armature="0.1"'
            '/></default>[[<default><joint damping="1"/>'
            "</default>]]"
        ),
    ),
    Entry(
        "names with spaces and slashes",
        arm(
            shoulder='axis="1 0 0"',
            in_fore=FORE
            + (
                '<body name="grip/left finger" pos="0 0.1 0"><joint '
                'name="left finger" axis="1 1 0"/>'
                f"{GEOM}</body>"
            ),
        ),
    ),
)

ALL = (
    *DEFAULT,
    *MACROS,
)
