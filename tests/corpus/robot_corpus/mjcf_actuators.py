"""What `actuator` and `tendon` can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, arm


def _driven(name: str, actuators: str, refusal: str = "", *, inert: bool = True) -> Entry:
    return Entry(
        name,
        arm(
            after=f'<actuator>{actuators}<motor joint="shoulder"/><motor joint="wrist"/>'
            "</actuator>",
            in_hand='<site name="grip" pos="0.1 0.2 0"/>'
            + '<inertial pos="0.02 0.07 0.03" mass="0.6" '
            'diaginertia="0.003 0.002 0.004"/>',
        ),
        refusal=refusal,
        inert=inert,
    )


def _tendon(name: str, attributes: str, refusal: str = "tendon", *, inert: bool = False) -> Entry:
    return Entry(
        name,
        arm(
            after=f'<tendon><fixed name="t" {attributes}><joint joint="shoulder" coef="0.8"/>'
            '<joint joint="elbow" coef="-0.5"/></fixed></tendon>'
        ),
        refusal=refusal,
        inert=inert,
    )


def _cable(name: str, attributes: str, refusal: str = "tendon", *, inert: bool = False) -> Entry:
    return Entry(
        name,
        arm(
            world='<site name="start" pos="0 -0.5 1"/>',
            in_fore=FORE + '<site name="end" pos="0 0 0.2"/>',
            after=f'<tendon><spatial name="t" {attributes}><site site="start"/>'
            '<site site="end"/></spatial></tendon>',
        ),
        refusal=refusal,
        inert=inert,
    )


_WRAP = arm(
    world='<site name="start" pos="0 -0.5 1"/><site name="beside" pos="0 -0.5 1.4"/>',
    in_upper='<inertial pos="0.1 0 0" mass="2" diaginertia="0.1 0.2 0.15"/><geom name="drum" '
    'type="cylinder" size="0.05 0.2" contype="0" conaffinity="0"/><site name="side" '
    'pos="0 0 0.1"/>',
    in_fore=FORE + '<site name="end" pos="0 0 0.2"/>',
    after='<tendon><spatial name="t" [[stiffness="50"]]><site site="start"/><geom geom="drum" '
    'sidesite="side"/><site site="end"/><pulley divisor="2"/><site site="beside"/>'
    '<site site="end"/>'
    "</spatial></tendon>",
)

ACTUATORS = (
    _driven("actuator motor gear", '<motor joint="elbow" [[gear="-80"]]/>'),
    _driven("actuator position", '[[<position kp="50" kv="3"||<motor]] joint="elbow"/>'),
    _driven("actuator velocity", '[[<velocity kv="3"||<motor]] joint="elbow"/>'),
    _driven("actuator damper", '[[<damper kv="3" ctrlrange="0 1"||<motor]] joint="elbow"/>'),
    _driven(
        "actuator intvelocity", '[[<intvelocity kp="3" actrange="-1 1"||<motor]] joint="elbow"/>'
    ),
    _driven(
        "actuator general",
        '[[<general gainprm="3" biastype="affine" biasprm="1 2 3"||<motor]] joint="elbow"/>',
    ),
    _driven("actuator cylinder", '[[<cylinder timeconst="0.1" area="2"||<motor]] joint="elbow"/>'),
    _driven("actuator pid", '[[<pid kp="3" ki="2"||<motor]] joint="elbow"/>'),
    _driven(
        "actuator dcmotor",
        '[[<dcmotor motorconst="0.05" resistance="1"||<motor]] joint="elbow"/>',
    ),
    _driven("actuator muscle", '[[<muscle lengthrange="0 1"||<motor]] joint="elbow"/>'),
    _driven("actuator jointinparent", '<motor [[jointinparent||joint]]="elbow"/>'),
    _driven("actuator armature", '<motor joint="elbow" [[armature="0.3"]]/>', inert=False),
    _driven(
        "actuator armature with a gear",
        '<motor joint="elbow" gear="3" [[armature="0.3"]]/>',
        inert=False,
    ),
    _driven("actuator damping", '<motor joint="elbow" [[damping="0.3"]]/>', inert=False),
    _driven(
        "actuator damping with a gear",
        '<motor joint="elbow" gear="3" [[damping="0.3"]]/>',
        inert=False,
    ),
    _driven(
        "actuators: two at one joint",
        '<motor joint="elbow"/>[[<damper joint="elbow" kv="1" ctrlrange="0 1"/>]]',
    ),
    _driven(
        "actuator limits, group and delay",
        '<motor joint="elbow" [[ctrlrange="-1 1" forcerange="-2 2" group="3"]]/>',
    ),
    _driven(
        "actuator at a site",
        '<motor joint="elbow"/>[[<motor site="grip" gear="1 0 0 0 0 0"/>]]',
        "actuator",
    ),
    _driven(
        "actuator adhesion", '<motor joint="elbow"/>[[<adhesion body="fore" ctrlrange="0 1"/>]]'
    ),
    _driven(
        "actuator of a slider and a crank",
        '<motor joint="elbow"/>[[<motor slidersite="grip" cranksite="grip" cranklength="0.1"/>]]',
        "actuator",
    ),
    Entry(
        "actuator order that is not the tree's",
        arm(
            after='<actuator><motor joint="wrist"/><motor joint="shoulder"/><motor joint="elbow"/>'
            "</actuator>"
        ),
    ),
    Entry(
        "actuator missing at one joint",
        arm(after='<actuator><motor joint="wrist"/><motor joint="shoulder"/></actuator>'),
        unreadable=True,
        refusal="actuator",
    ),
    Entry(
        "actuator of a tendon",
        arm(
            after='<tendon><fixed name="t"><joint joint="shoulder" coef="1"/><joint joint="elbow" '
            'coef="-0.5"/></fixed></tendon><actuator><motor tendon="t"/><motor joint="shoulder"/>'
            '<motor joint="wrist"/></actuator>'
        ),
        unreadable=True,
        refusal="actuator",
    ),
)


def _band(name: str, attributes: str, refusal: str = "", **places: str) -> Entry:
    tendon = f'<tendon><fixed {attributes}><joint joint="elbow" coef="-0.5"/></fixed></tendon>'
    return Entry(f"tendon along one joint: {name}", arm(after=tendon, **places), refusal)


TENDONS = (
    _band("stiffness", '[[stiffness="5"]]'),
    _band("springlength", 'stiffness="5" [[springlength="0.7"]]'),
    _band("springlength with a dead band", 'stiffness="5" [[springlength="0.1 0.7"]]', "tendon"),
    _band(
        "stiffness beside the joint's",
        '[[stiffness="5" springlength="0.7"]]',
        elbow='stiffness="3" springref="20"',
    ),
    _band("damping", '[[damping="0.5"]]'),
    _band("damping that is a polynomial", 'damping="0.5[[ 0.3]]"', "tendon"),
    _band("frictionloss", '[[frictionloss="0.5"]]'),
    _band("frictionloss beside the joint's", '[[frictionloss="0.5"]]', elbow='frictionloss="1"'),
    _band("armature", '[[armature="0.5"]]'),
    Entry(
        "tendon along one joint with a motor",
        arm(
            after='<tendon><fixed name="t"><joint joint="elbow" coef="-0.5"/></fixed></tendon>'
            "<actuator>"
            '<motor [[tendon="t"||joint="elbow"]]/><motor joint="shoulder"/><motor joint="wrist"/>'
            "</actuator>"
        ),
        inert=True,
    ),
    Entry("tendon spatial over a drum and a pulley", _WRAP, refusal="tendon"),
    _tendon("tendon fixed without forces", '[[group="1"]]', "", inert=True),
    _tendon("tendon fixed with limits", '[[limited="true" range="-1 1"]]', "", inert=True),
    _tendon("tendon fixed stiffness", '[[stiffness="5"]]'),
    _tendon("tendon fixed springlength", 'stiffness="5" [[springlength="0.7"]]'),
    _tendon(
        "tendon fixed springlength with a dead band", 'stiffness="5" [[springlength="0.1 0.7"]]'
    ),
    _tendon(
        "tendon fixed springlength without stiffness", '[[springlength="0.7"]]', "", inert=True
    ),
    _tendon("tendon fixed damping", '[[damping="0.5"]]'),
    _tendon("tendon fixed frictionloss", '[[frictionloss="0.5"]]'),
    _tendon("tendon fixed armature", '[[armature="0.5"]]'),
    _cable("tendon spatial without forces", '[[width="0.01"]]', "", inert=True),
    _cable("tendon spatial with limits", '[[limited="true" range="0 1"]]', "", inert=True),
    _tendon("tendon fixed springyield", 'stiffness="5" [[springyield="0.1"]]', inert=True),
    _cable("tendon spatial springyield", 'stiffness="50" [[springyield="0.1"]]', inert=True),
    _cable("tendon spatial stiffness", '[[stiffness="50"]]', ""),
    _cable("tendon spatial springlength", 'stiffness="50" [[springlength="0.7"]]', ""),
    _cable("tendon spatial damping", '[[damping="5"]]', ""),
    _cable("tendon spatial frictionloss", '[[frictionloss="5"]]', ""),
    _cable("tendon spatial armature", '[[armature="0.5"]]', ""),
)

ALL = (
    *ACTUATORS,
    *TENDONS,
)
