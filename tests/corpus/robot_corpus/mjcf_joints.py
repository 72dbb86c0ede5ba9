"""What `joint` can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, GEOM, HAND, UPPER, arm

JOINT = (
    Entry("joint hinge", arm(elbow='type="hinge" axis="0 1 0"')),
    Entry("joint slide", arm(elbow='[[type="slide"]] axis="0 1 0.2"')),
    Entry("joint axis not of unit length", arm(elbow='axis="[[0 3 4||1 0 0]]"')),
    Entry("joint axis by default", arm(elbow='[[||axis="1 0 0"]]')),
    Entry("joint axis against z", arm(elbow='axis="0 0 [[-1||1]]"')),
    Entry("joint kind by default", arm(elbow='[[||type="slide"]] axis="0 1 0"')),
    Entry("joint pos off the centre", arm(elbow='axis="0 1 0" [[pos="0.1 0.2 -0.3"]]')),
    Entry(
        "joint pos of a slide",
        arm(wrist='type="slide" axis="1 0 0" [[pos="0.1 0.2 0"]]'),
        inert=True,
    ),
    Entry(
        "joint pos in a turned body",
        arm(fore='pos="0.4 0 0" euler="20 30 40"', elbow='axis="0 1 0" [[pos="0.1 0.2 -0.3"]]'),
    ),
    Entry("joints: two in one body", arm(in_fore=FORE + '[[<joint name="twist" axis="1 0 0"/>]]')),
    Entry(
        "joints: three in one body, off the centre",
        arm(
            in_fore=FORE + '<joint name="lift" type="slide" axis="0 0 1"/><joint name="twist" '
            'axis="1 0 0" [[pos="0.1 0.2 0.3"]]/>',
            elbow='axis="0 1 0" pos="-0.1 0 0.2"',
        ),
    ),
    Entry(
        "joints: two hinges about one line",
        arm(
            in_fore=FORE + '<joint name="again" axis="0 1 0"/>', elbow='axis="0 1 0" armature="0.1"'
        ),
    ),
    Entry(
        "joints: two in the body in the root",
        arm(in_upper=UPPER + '[[<joint name="twist" axis="1 0 0.5" pos="0 0.1 0"/>]]'),
    ),
    Entry(
        "joint without a name",
        arm(
            in_hand=HAND
            + f'<body name="tip" pos="0.1 0 0"><joint [[||name="tip"]] axis="0 1 1"/>{GEOM}'
            "</body>"
        ),
        inert=True,
    ),
    Entry("joint armature", arm(elbow='axis="0 1 0" [[armature="0.7"]]')),
    Entry("joint damping", arm(elbow='axis="0 1 0" [[damping="0.7"]]')),
    Entry(
        "joint damping that is a polynomial",
        arm(elbow='axis="0 1 0" damping="0.7[[ 0.5]]"'),
        refusal="damping",
    ),
    Entry("joint frictionloss", arm(elbow='axis="0 1 0" [[frictionloss="0.7"]]')),
    Entry("joint stiffness", arm(elbow='axis="0 1 0" [[stiffness="7"]]')),
    Entry(
        "joint stiffness of a slide",
        arm(wrist='type="slide" [[stiffness="70"]]'),
    ),
    Entry(
        "joint stiffness that is a polynomial",
        arm(elbow='axis="0 1 0" stiffness="7[[ 2]]"'),
        refusal="stiffness",
    ),
    Entry(
        "joint springref",
        arm(elbow='axis="0 1 0" stiffness="7" [[springref="40"]]'),
    ),
    Entry(
        "joint springref of a slide",
        arm(wrist='type="slide" stiffness="7" [[springref="0.2"]]'),
    ),
    Entry(
        "joint springref without a spring", arm(elbow='axis="0 1 0" [[springref="40"]]'), inert=True
    ),
    Entry("joint springdamper", arm(elbow='axis="0 1 0" [[springdamper="0.5 1"]]')),
    Entry(
        "joint springyield",
        arm(elbow='axis="0 1 0" stiffness="7" [[springyield="0.1"]]'),
        inert=True,
        refusal="spring",
    ),
    Entry("joint ref", arm(elbow='axis="0 1 0" [[ref="30"]]')),
    Entry("joint ref of a slide", arm(wrist='type="slide" axis="1 0 1" [[ref="0.3"]]')),
    Entry("joint ref off the centre", arm(elbow='axis="0 1 0" pos="0.1 0 0.2" [[ref="-70"]]')),
    Entry(
        "joint ref with a spring",
        arm(elbow='axis="0 1 0" stiffness="5" springref="10" [[ref="30"]]'),
    ),
    Entry(
        "joint ref, two in one body",
        arm(in_fore=FORE + '<joint name="twist" axis="1 0 0" [[ref="50"]]/>'),
    ),
    Entry(
        "joint range, margin and limits",
        arm(elbow='axis="0 1 0" [[limited="true" range="-30 30" margin="1" solreflimit="0.1 1"]]'),
        inert=True,
    ),
    Entry(
        "joint actuatorfrcrange",
        arm(elbow='axis="0 1 0" [[actuatorfrclimited="true" actuatorfrcrange="-1 1"]]'),
        inert=True,
    ),
    Entry(
        "joint actuatorgravcomp",
        arm(
            fore='pos="0.4 0 0" gravcomp="[[1||0]]"',
            elbow='axis="0 1 0" [[actuatorgravcomp="true"]]',
        ),
        refusal="gravcomp",
    ),
    Entry(
        "joint group and user data",
        arm(top='<size nuser_jnt="1"/>', elbow='axis="0 1 0" [[group="3" user="7"]]'),
        inert=True,
    ),
    Entry(
        "joint ball",
        arm(in_hand=f'{HAND}<body name="tip"><joint name="tip" type="ball"/>{GEOM}</body>'),
        unreadable=True,
        refusal="ball",
    ),
    Entry(
        "joint free",
        arm(world=f'[[<body name="stone"><joint name="float" type="free"/>{GEOM}</body>]]'),
        inert=True,
    ),
    Entry(
        "joint freejoint",
        arm(world=f'[[<body name="stone"><freejoint name="float" align="true"/>{GEOM}</body>]]'),
        inert=True,
    ),
)

ALL = (*JOINT,)
