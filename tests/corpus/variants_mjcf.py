"""What an MJCF can say that changes the dynamics: a table of variants by the place where it stands.

Each is put into an otherwise plain robot of `robots_mjcf`. A sentence that refuses one of `REFUSED`
must hold the word beside it.
"""

from .robots_mjcf import FORE, GEOM, HAND, HANDLE, HOME, MOTORS, UPPER, arm, ball_wrist, four_bar

_MESH = '<asset><mesh name="wedge" {} vertex="0 0 0 0.3 0 0 0 0.2 0 0 0 0.1 0.3 0.2 0.05"/></asset>'
_TOOL = '<geom type="mesh" mesh="wedge" pos="0.02 0.05 0.01"/>'
_CLASSES = (
    '<default><joint damping="2" armature="0.1" frictionloss="0.7"/><geom density="2700"/>'
    '<tendon stiffness="9"/><default class="one"><joint armature="0.3"/><geom mass="2"/>'
    '<default class="two"><joint damping="5"/></default></default></default>'
)
_TURNED = 'pos="0.1 -0.2 0.4" euler="30 -50 70"'
_COUPLED = (
    '<equality><joint joint1="elbow" joint2="shoulder" {}/></equality>'
    '<actuator><motor joint="shoulder"/><motor joint="wrist"/></actuator>'
)
_BAND = '<tendon><fixed {}><joint joint="elbow" coef="-0.5"/></fixed></tendon>'
_FIXED = (
    '<tendon><fixed {}><joint joint="shoulder" coef="0.8"/><joint joint="elbow" coef="-0.5"/>'
    "</fixed></tendon>"
)
_CABLE = '<tendon><spatial {}><site site="start"/>{}<site site="end"/></spatial></tendon>'
_DRIVEN = (
    '<actuator>{}<motor joint="shoulder"/><motor joint="wrist"/></actuator>'
    '<default><site size="0.1"/></default>'
)


def _solid(top="", **places):
    return arm(top, **({"in_upper": GEOM, "in_fore": GEOM, "in_hand": HANDLE} | places))


def _cable(attributes, wrapped=""):
    return arm(
        world='<site name="start" pos="0 -0.5 1"/>',
        in_upper=UPPER + '<geom name="drum" type="cylinder" size="0.05 0.2" mass="0"/>',
        in_fore=FORE + '<site name="end" pos="0 0 0.2"/>',
        after=_CABLE.format(attributes, wrapped),
    )


def _inertial(attributes):
    return arm(in_fore=f'<inertial pos="0.1 0.2 -0.3" mass="2" {attributes}/>')


def _extra(place, inside=""):
    """Return one more body in a place of the fore arm, with what is inside."""
    return f"{FORE}<body name='extra' {place}>{inside}{GEOM}</body>"


def _welded(equality, motors=""):
    angle = sum(map(float, HOME.split()))
    post = (
        '<body name="post" pos="0.6 0 0"><joint name="post" pos="0.1 0 0" damping="0.3"/><site '
        'name="pin" pos="0.1 0 0"/><inertial pos="0.2 0.01 0.02" mass="1.2" '
        'diaginertia="0.001 0.006 0.006"/></body>'
    )
    text = four_bar(equality=equality, in_base=post, after=motors)
    return text.replace(f'qpos="{HOME}"', f'qpos="{angle} {HOME}"')


#: By what makes the robot of a text: the texts.
READ = {
    lambda x: arm(elbow=x): (
        'type="slide" axis="0 1 0.2"',
        'axis="0 3 4"',
        'axis="0 0 -1"',
        'axis="0 1 0" pos="0.1 0.2 -0.3"',
        'axis="0 1 0" armature="0.7" damping="0.5" frictionloss="0.3"',
        'axis="0 1 0" stiffness="7" springref="40"',
        'axis="0 1 0" springdamper="0.5 1"',
        'axis="0 1 0" ref="30" pos="0.1 0 0.2"',
        'axis="0 1 0" stiffness="5" springref="10" ref="30"',
    ),
    lambda x: arm(wrist=f'type="slide" axis="1 0.5 0" {x}'): (
        'pos="0.1 0.2 0"',
        'stiffness="7" springref="0.2" ref="0.3"',
    ),
    lambda x: arm(fore=x): (
        'quat="0.7 0.1 -0.5 0.3"',
        'axisangle="1 2 -2 50"',
        'xyaxes="2 1 0 -1 1 0.5"',
        'zaxis="0.3 -2 1"',
        'euler="10 -20 130" pos="0.4 0.05 -0.1"',
    ),
    lambda x: arm(base=x): ('quat="0 1 0 0"', 'pos="1 2 3" euler="20 30 40"', 'zaxis="0 0 -1"'),
    lambda x: arm(f"<compiler {x}/>", upper=_TURNED): (
        'angle="radian"',
        'angle="degree"',
        'eulerseq="XYZ"',
        'eulerseq="zXy"',
        'boundmass="1" boundinertia="0.05"',
        'settotalmass="12"',
    ),
    lambda x: arm(f"<option {x}/>"): ('gravity="4 -3 -8"', 'gravity="0 0 0"'),
    lambda x: arm(
        f'<option><flag {x}="disable"/></option>',
        elbow='stiffness="7" springref="20" damping="7" frictionloss="7"',
    ): ("gravity", "spring", "damper", "frictionloss", "constraint"),
    _inertial: (
        'quat="1 2 3 4" diaginertia="0.1 0.2 0.15"',
        'axisangle="1 1 3 70" diaginertia="0.1 0.2 0.15"',
        'zaxis="1 1 0" diaginertia="0.1 0.2 0.15"',
        'fullinertia="0.1 0.2 0.15 0.03 -0.02 0.04"',
    ),
    lambda x: arm(in_fore=f'<geom euler="20 40 60" {x}/>'): (
        'type="sphere" size="0.1" mass="4" pos="0.1 0.02 0"',
        'type="capsule" size="0.05 0.2" density="400" pos="0.1 0.02 0"',
        'type="ellipsoid" size="0.05 0.1 0.2" shellinertia="true" pos="0.1 0.02 0"',
        'type="cylinder" size="0.05 0.2" pos="0.1 0.02 0"',
        'type="capsule" size="0.04" fromto="0 0 0.1 0.3 0.1 -0.1"',
    ),
    lambda x: arm(_MESH.format(x), in_fore=_TOOL): (
        'scale="2 1 -3"',
        'inertia="shell"',
        'refpos="0.1 0 0" refquat="1 0 1 0"',
    ),
    lambda x: arm(_CLASSES, in_hand=HANDLE, **x): (
        {"elbow": 'axis="0 1 0" class="two"'},
        {"fore": 'pos="0.4 0.05 -0.1" childclass="one"', "in_fore": GEOM},
        {"in_fore": f'{FORE}<frame childclass="one">{_extra("").removeprefix(FORE)}</frame>'},
        {"after": _BAND.format("")},
    ),
    lambda x: arm(in_fore=x): (
        f'{FORE}<joint name="twist" axis="1 0 0" ref="50"/>',
        f'{FORE}<joint name="lift" type="slide" axis="0 0 1"/><joint name="twist" '
        'axis="1 0 0" pos="0.1 0.2 0.3"/>',
        f'{FORE}<joint name="again" axis="0 1 0"/>',
        f'<frame pos="0.1 0 0" axisangle="0 1 1 30"><frame quat="1 0 1 0">{GEOM}</frame></frame>',
        f'<replicate count="3" offset="0 0.1 0" euler="0 0 30">{GEOM}</replicate>',
        f'{FORE}<replicate count="2" offset="0 0.2 0"><body name="finger"><joint name="finger"/>'
        f"{GEOM}</body></replicate>",
        _extra('pos="0 0.1 0.2" quat="1 0 0.3 0"'),
        _extra('pos="0 0.1 0.2" euler="0 0 20"', '<joint name="jaw" axis="0 1 1"/>'),
        _extra('pos="0 0.1 0.2"', _extra('pos="0 0.3 0" euler="90 0 0"').replace("extra", "x")),
    ),
    lambda x: arm(world=x): (
        f'<body name="table" quat="1 1 0 0"><body name="arm" pos="0 1 0"><joint name="first" '
        f'axis="1 0 0"/>{GEOM}</body></body>',
        f'<body name="alone" pos="2 0 0"><joint name="alone" axis="0 1 0"/>{GEOM}</body>',
    ),
    lambda x: arm(after=_BAND.format(x), elbow='stiffness="3" springref="20" frictionloss="1"'): (
        'stiffness="5" springlength="0.7"',
        'damping="0.5" frictionloss="0.5" armature="0.5"',
    ),
    lambda x: arm(after=_FIXED.format(x)): (
        'limited="true" range="-1 1" stiffness="5" springlength="0.7"',
        'damping="0.5" armature="0.5" frictionloss="0.5"',
    ),
    _cable: (
        'stiffness="50" springlength="0.7"',
        'damping="5" frictionloss="5"',
        'armature="0.5"',
    ),
    lambda x: arm(after=_DRIVEN.format(f"<{x}/>"), in_hand=f'{HAND}<site name="grip"/>'): (
        'motor joint="elbow" gear="-80" ctrlrange="-1 1" forcerange="-2 2"',
        'position kp="50" kv="3" joint="elbow"',
        'velocity kv="3" joint="elbow"',
        'general gainprm="3" biastype="affine" biasprm="1 2 3" joint="elbow"',
        'motor jointinparent="elbow"',
        'motor joint="elbow" gear="3" armature="0.3" damping="0.2"',
    ),
    lambda x: arm(
        after=_COUPLED.format(x), shoulder='axis="0.2 -1 0.3" ref="20"', elbow='damping="0.4"'
    ): ("", 'polycoef="0.2 -2.5 0 0 0"', 'polycoef="0.1 -0.5 0.3 0.2 -0.1"'),
    lambda x: four_bar(upright=True, equality=f'<connect body1="rocker" {x}/>'): (
        'body2="post" anchor="0.4 0 0"',
        'anchor="0.4 0 0" solref="0.1 2"',
    ),
    lambda x: four_bar(in_base=x): (
        '<site name="pin" pos="0.7 0 0" euler="0.3 0.4 0.5"/>',
        '<site name="pin" type="capsule" size="0.01" fromto="0.6 0 0 0.8 0 0"/>',
    ),
    lambda x: four_bar(**x): (
        {"base": 'quat="0.9 0.3 0.2 0.1" pos="1 2 3"'},
        {"top": '<option gravity="2 0 5"/>'},
        {"rocker": 'damping="0.6"', "rod": 'frictionloss="0.6" armature="0.3"'},
        {"rod": 'stiffness="3" springref="0.5"', "crank": 'armature="0.1" damping="0.4"'},
        {"equality": '<connect site1="tip" site2="pin"/>' * 2},
    ),
    _welded: ('<weld site1="tip" site2="pin"/>', '<weld site1="pin" site2="tip"/>'),
    lambda x: x: (
        ball_wrist(),
        arm(after='<equality><joint joint1="elbow" polycoef="0.6 0 0 0 0"/></equality>'
            '<actuator><motor joint="shoulder"/><motor joint="wrist"/></actuator>'),
        arm(after='<equality><joint joint1="elbow" joint2="shoulder" polycoef="0 2 0 0 0"/>'
            '<joint joint1="wrist" joint2="elbow" polycoef="0 0.2 0.05 0 0"/></equality>'
            '<actuator><motor joint="shoulder"/></actuator>'),
        _welded('<weld site1="tip" site2="pin" torquescale="0"/>',
                '<actuator><motor joint="post"/><motor joint="crank"/></actuator>'),
        arm(after='<actuator><motor joint="wrist"/><motor joint="shoulder"/><motor joint="elbow"/>'
            "</actuator>"),
    ),
    # What changes nothing, at once.
    lambda x: _solid(
        '<compiler autolimits="false" fusestatic="true" discardvisual="true" saveinertial="true" '
        'alignfree="true" usethread="false"/><option magnetic="1 2 3" timestep="0.1" '
        'integrator="implicitfast" cone="elliptic" solver="PGS" wind="3 1 -2"><flag '
        'contact="disable" limit="disable" actuation="disable" eulerdamp="disable" '
        'invdiscrete="enable" sleep="enable"/></option><statistic meanmass="3"/>',
        after=x,
    ): (
        f'{MOTORS}<keyframe><key name="home" qpos="0.5 -0.4 0.1"/></keyframe>'
        '<sensor><jointpos joint="elbow"/></sensor>',
    ),
}  # fmt: skip

#: The same for what is refused: a word of the sentence, and the texts.
REFUSED = {
    lambda x: arm(elbow=f'axis="0 1 0" {x}'): {
        'damping="0.7 0.5"': "damping",
        'stiffness="7 2"': "stiffness",
        'stiffness="7" springyield="0.1"': "spring",
    },
    lambda x: arm(fore=x): {'gravcomp="1"': "gravcomp"},
    lambda x: _solid(f"<option {x}/>"): {'density="1000"': "density", 'viscosity="0.9"': "viscos"},
    lambda x: arm(after=_BAND.format(x)): {
        'stiffness="5" springlength="0.1 0.7"': "tendon",
        'damping="0.5 0.3"': "tendon",
    },
    lambda x: _cable('stiffness="50"', x): {'<geom geom="drum"/>': "tendon"},
    _cable: {'stiffness="50" springyield="0.1"': "tendon"},
    lambda x: arm(after=f'<actuator>{x}<motor joint="shoulder"/></actuator>'): {
        "": "actuator",
        '<motor joint="wrist"/>': "actuator",
    },
    lambda x: four_bar(in_base=x): {'<site name="pin" pos="2.9 0 0"/>': "close"},
    lambda x: four_bar(equality=x): {
        '<weld site1="tip" site2="pin"/>': "independent equations",
    },
    lambda x: arm(in_hand=f'{HAND}<body name="tip">{x}{GEOM}</body>'): {
        '<joint type="ball"/>': "ball",
    },
}
