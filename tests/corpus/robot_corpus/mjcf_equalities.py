"""What `equality` can change."""

from typing import Any

from robot_corpus.entry import Entry
from robot_corpus.mjcf import GEOM, HOME, MOTORS, arm, ball_wrist, four_bar

_GROUND = '<site name="pin" pos="[[0.7||0.75]] 0 0"/>'
_PLAIN = '<connect site1="tip" site2="pin"/>'
_TWO = '<actuator><motor joint="shoulder"/><motor joint="wrist"/></actuator>'


def _bar(
    name: str, refusal: str = "", *, inert: bool = False, unreadable: bool = False, **places: Any
) -> Entry:
    return Entry(name, four_bar(**places), refusal, unreadable, inert, spread=0.4)


def _welded(name: str, equality: str, motor: str = "") -> Entry:
    """Return a four-bar whose rocker is welded to a post that turns on the ground."""
    angle = sum(map(float, HOME.split()))
    post = (
        '<body name="post" pos="0.6 0 0"><joint name="post" pos="0.1 0 0" damping="0.3"/>'
        '<site name="pin" pos="0.1 0 0"/>'
        '<inertial pos="0.2 0.01 0.02" mass="[[1.2||1]]" diaginertia="0.001 0.006 0.006"/></body>'
    )
    text = four_bar(equality=equality, in_base=post, after=motor)
    return Entry(name, text.replace(f'qpos="{HOME}"', f'qpos="{angle} {HOME}"'), spread=0.4)


def _coupled(name: str, polynomial: str, refusal: str = "", **places: str) -> Entry:
    equality = f'<equality><joint joint1="elbow" joint2="shoulder" {polynomial}/></equality>'
    return Entry(name, arm(after=equality + _TWO, **places), refusal=refusal, spread=1.2)


LOOPS = (
    _bar("equality connect of two sites"),
    _bar("equality connect to a site on the ground", in_base=_GROUND),
    _bar(
        "equality connect to a site on the turned ground",
        base='euler="0.2 0.3 0.5" pos="1 2 3"',
        in_base=_GROUND,
    ),
    _bar(
        "equality connect to a site in the world",
        in_base="",
        world='<site name="pin" pos="[[0.7||0.75]] 0 0"/>',
    ),
    _bar(
        "equality connect with the ground first",
        in_base=_GROUND,
        equality='<connect site1="pin" site2="tip"/>',
    ),
    _bar(
        "equality connect of body and anchor",
        upright=True,
        equality='<connect body1="rocker" body2="post" anchor="[[0.4||0.35]] 0 0"/>',
    ),
    _bar(
        "equality connect of body and anchor with the root first",
        upright=True,
        equality='<connect body1="base" body2="rocker" anchor="[[0.7||0.75]] 0 0"/>',
    ),
    _bar(
        "equality connect of body and anchor on the world",
        upright=True,
        equality='<connect body1="rocker" anchor="[[0.4||0.35]] 0 0"/>',
    ),
    _bar(
        "equality connect of body and anchor, the world named",
        upright=True,
        equality='<connect body1="rocker" body2="world" anchor="[[0.4||0.35]] 0 0"/>',
    ),
    _bar(
        "equality connect solver settings",
        equality='<connect site1="tip" site2="pin" [[solref="0.1 2" solimp="0.5 0.6 0.1"]]/>',
        inert=True,
    ),
    _bar(
        "equality connect that is not active",
        equality=_PLAIN + '[[<connect site1="tip" site2="pin" active="false"/>]]',
        inert=True,
    ),
    _bar("equality connect that stands twice", equality=_PLAIN + f"[[{_PLAIN}]]", inert=True),
    _bar(
        "equality connect that is open at home",
        equality='<connect site1="tip" site2="pin"/>',
        in_base='<site name="pin" pos="2.9 0 0"/>',
        unreadable=True,
        refusal="close",
    ),
    _bar(
        "equality connect that is open at home but could be closed",
        unreadable=True,
        refusal="close",
        in_base='<site name="pin" pos="0.4 0 0"/>',
    ),
    _bar(
        "equality weld of two sites",
        equality='<weld site1="tip" site2="pin"/>',
        unreadable=True,
        refusal="independent equations",
    ),
    _bar(
        "equality weld of two bodies",
        equality='<weld body1="rocker" body2="post"/>',
        unreadable=True,
        refusal="independent equations",
    ),
    _welded("equality weld of two sites, one of which can turn", '<weld site1="tip" site2="pin"/>'),
    _welded("equality weld of two sites with the other first", '<weld site1="pin" site2="tip"/>'),
    _welded(
        "equality weld by relpose and anchor",
        '<weld body1="rocker" body2="post" anchor="-0.1 0.2 0.1" relpose="0.2 0.2 0.1 1 0 0 0"/>',
    ),
    _welded(
        "equality weld without torque",
        '<weld site1="tip" site2="pin" torquescale="0"/>',
        motor='<actuator><motor joint="post"/><motor joint="crank"/></actuator>',
    ),
    _bar(
        "equality connect of a site stretched from point to point",
        in_base=('<site name="pin" type="capsule" size="0.01" fromto="[[0.6||0.5]] 0 0 0.8 0 0"/>'),
    ),
    _bar(
        "equality connect of turned sites",
        in_base='<site name="pin" pos="0.7 0 0" [[euler="0.3 0.4 0.5"]]/>',
        inert=True,
    ),
    _bar("equality connect in a tilted plane", base='quat="[[0.9 0.3 0.2 0.1||1 0 0 0]]"'),
    _bar(
        "equality connect on a yawed base", base='euler="0 0 [[1.5707963267948966||0]]"', inert=True
    ),
    _bar("equality connect under gravity of its own", top='[[<option gravity="2 0 5"/>]]'),
    _bar("passive joint damping", rocker='[[damping="0.6"]]'),
    _bar("passive joint frictionloss", rod='[[frictionloss="0.6"]]'),
    _bar("passive joint armature", rod='[[armature="0.3"]]'),
    _bar("passive joint stiffness", rod='[[stiffness="3"]]'),
    _bar("passive joint springref", rod='stiffness="3" [[springref="0.5"]]'),
    _bar(
        "passive joint off the centre",
        rocker='[[pos="0.05 0 0.1"]]',
        upright=True,
        equality='<connect body1="rocker" anchor="0.4 0 0"/>',
    ),
    _bar(
        "actuated joint armature, damping and dry friction in a loop",
        crank='[[armature="0.1" damping="0.4" frictionloss="0.3"]]',
    ),
    _bar(
        "equality connect with gravcomp",
        in_rod=GEOM.replace("<geom", "[[<geom").replace("/>", "/>]]"),
        inert=True,
    ),
    _bar(
        "equality connect of spatial joints",
        in_rod='<joint name="sway" axis="0 0 1"/>',
        rod='axis="[[0.2||0]] -1 0.1"',
        upright=True,
        equality='<connect body1="rocker" anchor="0.4 0.08 0"/>',
    ),
    Entry("equality connect of three legs and a ball", ball_wrist(), spread=0.3),
    Entry(
        "equality joint without a second",
        arm(
            after='<equality><joint joint1="elbow" polycoef="[[0.6||0]] 0 0 0 0"/></equality>'
            + _TWO
        ),
    ),
    _coupled("equality joint by default", ""),
    _coupled("equality joint with a ratio", 'polycoef="0.2 [[-2.5||1]] 0 0 0"'),
    _coupled("equality joint polynomial", 'polycoef="0.1 -0.5 [[0.3 0.2 -0.1||0 0 0]]"'),
    _coupled(
        "equality joint with a joint ref",
        'polycoef="0.1 -0.5 0.3 0 0"',
        shoulder='axis="0.2 -1 0.3" [[ref="20"]]',
        elbow='axis="0 1 0" [[ref="-35"]]',
    ),
    _coupled(
        "equality joint with passive friction",
        "",
        elbow='axis="0 1 0" [[damping="0.4" frictionloss="0.5"]]',
    ),
    _coupled(
        "equality joint with passive armature",
        "",
        elbow='axis="0 1 0" [[armature="0.5"]]',
    ),
    Entry(
        "equality joint of a slide",
        arm(
            after='<equality><joint joint1="wrist" joint2="elbow" polycoef="0 [[0.2||0.1]] 0.05 0 '
            '0"/>'
            '</equality><actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>'
        ),
        spread=1.2,
    ),
    Entry(
        "equality joints in a row",
        arm(
            after='<equality><joint joint1="elbow" joint2="shoulder" polycoef="0 2 0 0 0"/>'
            '<joint joint1="wrist" joint2="elbow" polycoef="0 [[0.2||0.1]] 0 0 0"/></equality>'
            '<actuator><motor joint="shoulder"/></actuator>'
        ),
        spread=1.2,
    ),
    Entry(
        "equality joint that is not active",
        arm(
            after='[[<equality><joint joint1="elbow" joint2="shoulder" active="false"/>'
            "</equality>]]" + MOTORS
        ),
        inert=True,
    ),
    Entry(
        "equality tendon",
        arm(
            after='<tendon><fixed name="t"><joint joint="shoulder" coef="1"/><joint joint="elbow" '
            'coef="-0.5"/></fixed></tendon><equality><tendon tendon1="t"/></equality>' + _TWO
        ),
        refusal="tendon",
        spread=1.0,
    ),
)

ALL = (*LOOPS,)
