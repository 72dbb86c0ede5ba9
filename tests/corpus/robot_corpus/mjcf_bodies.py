"""What `body` and what stands beside the bodies can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, GEOM, MOTORS, arm, solid

_SECOND = f'<body name="second" pos="1 0 0"><joint name="other" axis="0 1 0"/>{GEOM}</body>'

BODY = (
    Entry("body pos", arm(fore='[[pos="0.4 0.05 -0.1"]]')),
    Entry("body quat", arm(fore='pos="0.4 0 0" [[quat="0.7 0.1 -0.5 0.3"]]')),
    Entry("body quat on the root", arm(base='[[quat="0 1 0 0"]]')),
    Entry("body pos and euler on the root", arm(base='[[pos="1 2 3" euler="20 30 40"]]')),
    Entry("body axisangle on the root", arm(base='[[axisangle="1 1 0 100"]]')),
    Entry("body axisangle not of unit length", arm(fore='[[axisangle="1 2 -2 50"]]')),
    Entry("body xyaxes not of unit length", arm(fore='[[xyaxes="2 1 0 -1 1 0.5"]]')),
    Entry("body zaxis", arm(fore='[[zaxis="0.3 -2 1"]]')),
    Entry("body zaxis down", arm(base='[[zaxis="0 0 -1"]]')),
    Entry("body euler", arm(fore='[[euler="10 -20 130"]]')),
    Entry("body gravcomp of one", arm(fore='pos="0.4 0 0" [[gravcomp="1"]]'), refusal="gravcomp"),
    Entry(
        "body gravcomp of a part", arm(hand='pos="0.3 0 0" [[gravcomp="0.4"]]'), refusal="gravcomp"
    ),
    Entry(
        "body gravcomp of everything",
        arm(
            upper='pos="0 0 0.4" [[gravcomp="1"]]',
            fore='pos="0.4 0 0" [[gravcomp="1"]]',
            hand='pos="0.3 0 0" [[gravcomp="1"]]',
        ),
        refusal="gravcomp",
    ),
    Entry(
        "body gravcomp on the root",
        arm(base='[[gravcomp="1"]]', in_base=GEOM),
        inert=True,
        refusal="gravcomp",
    ),
    Entry(
        "body mocap",
        arm(world='[[<body name="target" mocap="true"><geom size="0.1"/></body>]]'),
        inert=True,
    ),
    Entry(
        "body nested in static ones",
        arm(
            world='[[<body name="table" quat="1 1 0 0"><body name="plate" pos="0 0 1" '
            f'euler="0 90 0"><body name="arm" pos="0 1 0"><joint name="first" axis="1 0 0"/>{GEOM}'
            "</body></body></body>]]"
        ),
    ),
    Entry(
        "body fixed to a moving one",
        arm(
            in_fore=FORE
            + f'[[<body name="bracket" pos="0 0.1 0.2" quat="1 0 0.3 0">{GEOM}</body>]]'
        ),
    ),
    Entry(
        "body fixed to one that is fixed to a moving one",
        arm(
            in_fore=f'{FORE}<body name="bracket" pos="0 0.1 0.2" euler="0 0 20"><body name="screw" '
            f'[[pos="0 0.3 0" euler="90 0 0"]]>{GEOM}</body></body>'
        ),
    ),
    Entry(
        "body with a joint on a fixed one",
        arm(
            in_fore=f'{FORE}<body name="bracket" pos="0 0.1 0.2" [[euler="0 0 20"]]><body '
            'name="jaw" '
            f'pos="0.1 0 0"><joint name="jaw" axis="0 1 1"/>{GEOM}</body></body>'
        ),
    ),
    Entry(
        "body directly in the world",
        arm(
            world=f'[[<body name="alone" pos="2 0 0"><joint name="alone" axis="0 1 0"/>{GEOM}'
            "</body>]]"
        ),
    ),
    Entry(
        "body: two roots",
        arm(
            in_base=_SECOND,
            world=f"[[{_SECOND}]]".replace("second", "third").replace("other", "another"),
        ),
    ),
    Entry(
        "body without a name",
        arm(
            in_fore=f'{FORE}<body [[name="bracket"]] pos="0 0.1 0.2">{GEOM}</body>'.replace(
                '[[name="bracket"]]', '[[||name="bracket"]]'
            )
        ),
        inert=True,
    ),
    Entry(
        "body user data",
        arm(fore='pos="0.4 0.05 -0.1" [[user="1 2"]]', top='<size nuser_body="2"/>'),
        inert=True,
    ),
    Entry("body sleep", arm(upper='pos="0.1 -0.2 0.4" [[sleep="never"]]'), inert=True),
    Entry(
        "body fuse",
        arm(in_fore=f'{FORE}<body name="bracket" pos="0 0.1 0.2" [[fuse="false"]]>{GEOM}</body>'),
        inert=True,
    ),
    Entry("body simple", arm(fore='pos="0.4 0.05 -0.1" [[simple="false"]]'), inert=True),
    Entry(
        "worldbody geoms, lights and cameras",
        arm(
            world='[[<geom type="plane" size="1 1 0.1"/><light pos="0 0 3"/><camera pos="1 1 1"/>]]'
        ),
        inert=True,
    ),
)


OTHER = (
    Entry(
        "contacts between bodies",
        solid(
            world='<geom type="plane" size="3 3 0.1"/>',
            in_fore=GEOM.replace(
                'contype="0" conaffinity="0"', '[[||contype="0" conaffinity="0"]]'
            ),
        ),
        inert=True,
    ),
    Entry(
        "contact pair and exclude",
        solid(after='<contact>[[<exclude body1="upper" body2="fore"/>]]</contact>'),
        inert=True,
    ),
    Entry(
        "keyframe",
        arm(after='[[<keyframe><key name="home" qpos="0.5 -0.4 0.1"/></keyframe>]]'),
        inert=True,
    ),
    Entry(
        "keyframe without a home",
        arm(
            after='[[<keyframe><key time="1"/><key qpos="0.5 -0.4 0.1" qvel="1 2 3"/></keyframe>]]'
        ),
        inert=True,
    ),
    Entry("sensors", arm(after='[[<sensor><jointpos joint="elbow"/></sensor>]]'), inert=True),
    Entry(
        "custom data, statistics and sizes",
        arm(
            '[[<statistic meanmass="3"/><size memory="1M"/><custom><numeric name="a" data="1"/>'
            "</custom>]]"
        ),
        inert=True,
    ),
    Entry(
        "deformable flex",
        arm(
            '<size memory="10M"/>',
            after='<deformable><flex name="skin" dim="2" body="upper fore hand"'
            ' vertex="0 0 0 0.1 0 0 0 0.1 0" element="0 1 2" radius="0.01">[[<elasticity '
            'young="1e4" '
            'thickness="0.01" elastic2d="stretch"/>]]'
            "</flex></deformable>",
        ),
        refusal="flex",
    ),
    Entry("motors for all joints", arm(after=f"[[{MOTORS}]]"), inert=True),
)

ALL = (
    *BODY,
    *OTHER,
)
