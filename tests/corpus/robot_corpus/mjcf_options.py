"""What `compiler` and `option` can change."""

from robot_corpus.entry import Entry
from robot_corpus.mjcf import FORE, GEOM, MOTORS, UPPER, arm, four_bar, solid

_TURNED = 'pos="0.1 -0.2 0.4" euler="30 -50 70"'
_WIND = '<option density="1.2" [[wind="3 1 -2"]]/>'

COMPILER = (
    Entry("compiler angle: degrees unless it says otherwise", arm(upper=_TURNED)),
    Entry(
        "compiler angle in radians",
        arm('[[<compiler angle="radian"/>]]', upper='pos="0.1 0 0.4" euler="0.3 -0.5 0.7"'),
    ),
    Entry(
        "compiler angle, said by the last of two",
        arm('<compiler angle="radian"/>[[<compiler angle="degree"/>]]', upper=_TURNED),
    ),
    Entry(
        "compiler eulerseq about fixed axes",
        arm('<compiler [[eulerseq="XYZ"]]/>', upper=_TURNED),
    ),
    Entry(
        "compiler eulerseq in another order",
        arm('<compiler [[eulerseq="zyx"]]/>', upper=_TURNED),
    ),
    Entry(
        "compiler eulerseq of both kinds",
        arm('<compiler [[eulerseq="zXy"]]/>', upper=_TURNED),
    ),
    Entry("compiler autolimits", arm('[[<compiler autolimits="false"/>]]'), inert=True),
    Entry("compiler boundmass", arm('<compiler [[boundmass="1"]]/>')),
    Entry("compiler boundinertia", arm('<compiler [[boundinertia="0.05"]]/>')),
    Entry("compiler settotalmass", arm('<compiler [[settotalmass="12"]]/>')),
    Entry(
        "compiler balanceinertia",
        arm(
            '<compiler balanceinertia="[[true||false]]" [[||boundinertia="0.004"]]/>',
            in_fore='<inertial pos="0.1 0 0.1" mass="1" '
            'diaginertia="[[0.01 0.02 0.05||0.02 0.03 0.04]]"/>',
        ),
    ),
    Entry(
        "compiler inertiafromgeom always",
        arm(
            '<compiler [[inertiafromgeom="true"]]/>',
            in_upper=UPPER + GEOM,
            in_fore=GEOM,
            in_hand=GEOM,
        ),
    ),
    Entry(
        "compiler inertiafromgeom where no inertia is stated",
        arm(in_fore=f"[[{GEOM}||{FORE}]]"),
    ),
    Entry(
        "compiler inertiafromgeom never",
        arm('<compiler [[inertiafromgeom="false"]]/>', in_upper=UPPER + GEOM, in_fore=FORE + GEOM),
        inert=True,
    ),
    Entry(
        "compiler inertiagrouprange",
        solid(
            '<compiler [[inertiagrouprange="0 2"]]/>',
            in_fore=GEOM + '<geom group="3" size="0.1" pos="0 0.1 0"/>',
        ),
    ),
    Entry(
        "compiler fusestatic",
        solid(
            '<compiler [[fusestatic="true"]]/>',
            in_fore=GEOM + f'<body name="bolt" pos="0 0.1 0" quat="1 0.5 0 0">{GEOM}</body>',
        ),
        inert=True,
    ),
    Entry(
        "compiler discardvisual",
        solid('<compiler [[discardvisual="true"]]/>', in_fore=FORE + GEOM),
        inert=True,
    ),
    Entry("compiler saveinertial", solid('<compiler [[saveinertial="true"]]/>'), inert=True),
    Entry("compiler alignfree", arm('<compiler [[alignfree="true"]]/>'), inert=True),
    Entry("compiler usethread", solid('<compiler [[usethread="false"]]/>'), inert=True),
    Entry(
        "compiler lengthrange",
        arm('<compiler>[[<lengthrange mode="none"/>]]</compiler>'),
        inert=True,
    ),
    Entry("compiler coordinate", arm('<compiler [[coordinate="local"]]/>'), inert=True),
    Entry("compiler strippath", arm('<compiler [[strippath="true"]]/>'), inert=True),
)


OPTION = (
    Entry("option gravity of the moon", arm('[[<option gravity="0 0 -1.62"/>]]')),
    Entry("option gravity from the side", arm('[[<option gravity="4 -3 -8"/>]]')),
    Entry("option gravity none", arm('[[<option gravity="0 0 0"/>]]')),
    Entry(
        "option gravity, said by the last of two",
        arm('<option gravity="0 0 -1"/>[[<option gravity="0 0 -3.7"/>]]'),
    ),
    Entry("option flag gravity", arm('<option><flag [[gravity="disable"]]/></option>')),
    Entry("option density", solid('<option [[density="1000"]]/>'), refusal="density"),
    Entry("option viscosity", solid('<option [[viscosity="0.9"]]/>'), refusal="viscosity"),
    Entry("option wind", solid(_WIND), refusal="density"),
    Entry("option wind without a fluid", solid('<option [[wind="3 1 -2"]]/>'), inert=True),
    Entry("option magnetic", arm('<option [[magnetic="1 2 3"]]/>'), inert=True),
    Entry(
        "option timestep", arm('<option [[timestep="0.1"]]/>', shoulder='damping="3"'), inert=True
    ),
    Entry(
        "option integrator",
        arm('<option [[integrator="implicitfast"]]/>', shoulder='damping="3"'),
        inert=True,
    ),
    Entry(
        "option flag invdiscrete",
        arm(
            '<option timestep="0.05"><flag [[invdiscrete="enable"]]/></option>',
            shoulder='damping="3"',
        ),
        inert=True,
    ),
    Entry(
        "option solver settings",
        arm(
            '<option [[iterations="3" tolerance="0.1" impratio="5" cone="elliptic" '
            'jacobian="sparse" solver="PGS" noslip_iterations="2"]]/>'
        ),
        inert=True,
    ),
    Entry(
        "option overrides of contacts",
        arm(
            '<option [[o_margin="0.1" o_solref="0.1 1" o_friction="1 1 1 1 1"]]>'
            '<flag override="enable"/></option>'
        ),
        inert=True,
    ),
    Entry(
        "option flag spring",
        arm('<option><flag [[spring="disable"]]/></option>', elbow='stiffness="7" springref="20"'),
    ),
    Entry(
        "option flag damper",
        arm('<option><flag [[damper="disable"]]/></option>', elbow='damping="7"'),
    ),
    Entry(
        "option flag frictionloss",
        arm('<option><flag [[frictionloss="disable"]]/></option>', elbow='frictionloss="7"'),
    ),
    Entry(
        "option flag constraint",
        arm('<option><flag [[constraint="disable"]]/></option>', elbow='frictionloss="7"'),
    ),
    Entry(
        "option flag equality",
        arm(
            '<option><flag [[equality="disable"]]/></option>',
            '<equality><joint joint1="elbow" joint2="shoulder"/></equality>'
            '<actuator><motor joint="shoulder"/>[[<motor joint="elbow"/>]]'
            '<motor joint="wrist"/></actuator>',
        ),
    ),
    Entry(
        "option flag equality for a loop",
        four_bar(
            '<option><flag [[equality="disable"]]/></option>',
            after='<actuator>[[<motor joint="rod"/><motor joint="rocker"/>]]</actuator>',
        ),
        spread=0.4,
    ),
    Entry(
        "option flags of contact, limit, actuation and the rest",
        arm(
            '<option><flag [[contact="disable" limit="disable" actuation="disable" '
            'clampctrl="disable" warmstart="disable" filterparent="disable" refsafe="disable" '
            'sensor="disable" midphase="disable" eulerdamp="disable" autoreset="disable" '
            'nativeccd="disable" island="disable" energy="enable" fwdinv="enable" '
            'multiccd="disable"]]/></option>',
            MOTORS,
            elbow='damping="2" range="-20 20"',
        ),
        inert=True,
    ),
    Entry("option flag sleep", arm('<option><flag [[sleep="enable"]]/></option>'), inert=True),
    Entry(
        "option actuatorgroupdisable",
        arm('<option [[actuatorgroupdisable="0"]]/>', MOTORS),
        inert=True,
    ),
)

ALL = (
    *COMPILER,
    *OPTION,
)
