"""What the elements of a URDF can change."""

from robot_corpus.entry import Entry

_INERTIA = 'ixx="0.02" ixy="0.004" ixz="-0.003" iyy="0.09" iyz="0.002" izz="0.08"'
LINK = f'<inertial><origin xyz="0.2 0.03 -0.05"/><mass value="3"/><inertia {_INERTIA}/></inertial>'
TOOL = (
    '<inertial><origin xyz="0.02 0.07 0.03"/><mass value="0.6"/>'
    '<inertia ixx="0.003" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.004"/></inertial>'
)
_LIMIT = '<limit lower="-9" upper="9" effort="10" velocity="5"/>'


def _axis(xyz: str) -> str:
    return f'<axis xyz="{xyz}"/>' if xyz else ""


def arm(
    *,
    base: str = "",
    shoulder: str = "",
    elbow: str = "",
    wrist: str = "",
    kinds: tuple[str, str, str] = ("revolute", "revolute", "prismatic"),
    axes: tuple[str, str, str] = ("0.2 -1 0.3", "0 1 0", "1 0.5 0"),
    place: str = '<origin xyz="0.4 0.05 -0.1" rpy="0.2 0.3 -0.4"/>',
    upper: str = LINK,
    fore: str = LINK,
    hand: str = TOOL,
    more: str = "",
    limit: str = _LIMIT,
) -> str:
    """Return an arm of three joints; each argument goes where its name says."""
    names, places = (
        ("shoulder", "elbow", "wrist"),
        ('<origin xyz="0.1 -0.2 0.4"/>', place, '<origin xyz="0.3 -0.02 0.04"/>'),
    )
    links = ("base", "upper", "fore", "hand")
    joints = "\n".join(
        f'<joint name="{name}" type="{kind}"><parent link="{links[k]}"/>'
        f'<child link="{links[k + 1]}"/>{places[k]}{_axis(axis)}'
        f"{limit}{inside}</joint>"
        for k, (name, kind, axis, inside) in enumerate(
            zip(names, kinds, axes, (shoulder, elbow, wrist), strict=True)
        )
    )
    bodies = "\n".join(
        f'<link name="{name}">{inside}</link>'
        for name, inside in zip(links, (base, upper, fore, hand), strict=True)
    )
    return f'<robot name="arm">\n{bodies}\n{joints}\n{more}\n</robot>\n'


def _kind(name: str, kind: str, axis: str, refusal: str = "") -> Entry:
    text = arm(kinds=("revolute", kind, "prismatic"), axes=("0.2 -1 0.3", axis, "1 0.5 0"))
    return Entry(f"URDF {name}", text, refusal=refusal)


def _joint(parent: str, kind: str, more: str = "", *, link: str = "extra") -> str:
    return (
        f'<link name="{link}">{TOOL}</link><joint name="{link}" type="{kind}"><parent '
        f'link="{parent}"/><child link="{link}"/><origin xyz="0 0.2 0.1" rpy="0.5 0 1"/>'
        f'<axis xyz="0 1 1"/>{_LIMIT}{more}</joint>'
    )


def _mimic(name: str, mimic: str, more: str = "", refusal: str = "") -> Entry:
    return Entry(f"URDF mimic {name}", arm(elbow=mimic, more=more), refusal=refusal)


ALL = (
    _kind("revolute about x", "revolute", "1 0 0"),
    _kind("revolute about -y", "revolute", "0 -1 0"),
    _kind("revolute about a tilted axis", "revolute", "0.6 0 0.8"),
    _kind("revolute about an axis not of unit length", "revolute", "0 3 4"),
    _kind("revolute about an axis that is rounded", "revolute", "0.57735 0.57735 0.57735"),
    _kind("continuous about x", "continuous", "1 0 0"),
    _kind("continuous about y", "continuous", "0 1 0"),
    _kind("continuous about z", "continuous", "0 0 1"),
    _kind("continuous about -x", "continuous", "-1 0 0"),
    _kind("continuous about -y", "continuous", "0 -1 0"),
    _kind("continuous about -z", "continuous", "0 0 -1"),
    _kind("continuous about a tilted axis", "continuous", "0.36 -0.48 0.8"),
    _kind("continuous about nearly x", "continuous", "1 0 4.9e-12"),
    _kind("prismatic along x", "prismatic", "1 0 0"),
    _kind("prismatic along -z", "prismatic", "0 0 -1"),
    _kind("prismatic along a tilted axis", "prismatic", "0.36 -0.48 0.8"),
    _kind("prismatic along an axis not of unit length", "prismatic", "0 3 4"),
    _kind("axis by default", "revolute", ""),
    _kind("axis of zeros", "revolute", "0 0 0", "axis"),
    _kind("floating joint", "floating", "0 0 1", "floating"),
    _kind("planar joint", "planar", "0 0 1", "planar"),
    _kind("fixed joint", "fixed", "0 0 1"),
    Entry(
        "URDF continuous everywhere",
        arm(kinds=("continuous",) * 3, axes=("0 0 -1", "0 -1 0", "-1 0 0")),
    ),
    Entry("URDF origin xyz", arm(place='[[<origin xyz="0.4 0.05 -0.1"/>]]')),
    Entry("URDF origin rpy", arm(place='<origin xyz="0.4 0 0" [[rpy="0.3 -0.4 2"]]/>')),
    Entry(
        "URDF origin rpy in gimbal lock",
        arm(place='<origin xyz="0.4 0 0" [[rpy="0.3 1.5707963267948966 2"]]/>'),
    ),
    Entry(
        "URDF inertial origin rpy",
        arm(fore=LINK.replace("-0.05", '-0.05" [[rpy="0.3 -0.4 2"]]').replace(']]"', "]]")),
    ),
    Entry("URDF inertial of the base", arm(base=f"[[{LINK}]]"), inert=True),
    Entry("URDF link without inertial", arm(fore=f"[[||{LINK}]]")),
    Entry("URDF mass of zero", arm(hand=TOOL.replace("0.6", "[[0||0.6]]"))),
    Entry(
        "URDF fixed joint to the world",
        arm(
            more=(
                '[[<link name="world"/><joint name="mount" type="fixed"><parent link="world"/>'
                '<child link="base"/><origin xyz="1 2 3" rpy="3.14159265358979 0 0.4"/></joint>]]'
            )
        ),
    ),
    Entry("URDF fixed link with a mass", arm(more=f"[[{_joint('fore', 'fixed')}]]")),
    Entry(
        "URDF fixed links in a row",
        arm(more=_joint("fore", "fixed") + f"[[{_joint('extra', 'fixed', link='last')}]]"),
    ),
    Entry(
        "URDF joint after a fixed one",
        arm(more=_joint("fore", "fixed") + _joint("extra", "revolute", link="last")),
    ),
    Entry("URDF branches", arm(more=_joint("upper", "revolute", link="side"))),
    Entry("URDF dynamics damping", arm(elbow='[[<dynamics damping="0.7"/>]]')),
    Entry("URDF dynamics friction", arm(elbow='[[<dynamics friction="0.7"/>]]')),
    Entry(
        "URDF dynamics of a continuous joint",
        arm(
            kinds=("revolute", "continuous", "prismatic"),
            elbow='[[<dynamics damping="0.7" friction="0.4"/>]]',
        ),
    ),
    Entry(
        "URDF limits",
        arm(limit='<limit lower="[[-1||-2]]" upper="1" effort="1" velocity="1"/>'),
        inert=True,
    ),
    Entry("URDF limits missing", arm(limit="")),
    Entry(
        "URDF safety controller and calibration",
        arm(
            elbow='[[<safety_controller k_velocity="1" soft_lower_limit="-1"/>'
            '<calibration rising="0.1"/>]]'
        ),
        inert=True,
    ),
    Entry(
        "URDF transmission",
        arm(
            more=(
                '[[<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
                '<joint name="elbow"><hardwareInterface>EffortJointInterface</hardwareInterface>'
                "</joint>"
                '<actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>'
                "</transmission>]]"
            )
        ),
        inert=True,
    ),
    Entry(
        "URDF tags of others",
        arm(
            more=(
                '[[<gazebo reference="fore"><kp>1</kp></gazebo><mujoco><compiler '
                'angle="degree"/></mujoco>'
                '<ros2_control name="c" type="system"/>]]'
            )
        ),
        inert=True,
    ),
    Entry(
        "URDF visual and collision",
        arm(
            fore=LINK
            + (
                '[[<visual><geometry><box size="1 1 1"/></geometry><material name="red"><color '
                'rgba="1 0 0 1"/></material></visual><collision><geometry>'
                '<sphere radius="1"/></geometry>'
                "</collision>]]"
            )
        ),
        inert=True,
    ),
    Entry(
        "URDF mesh that is missing",
        arm(
            fore=LINK
            + ('[[<visual><geometry><mesh filename="package://arm/no.stl"/></geometry></visual>]]')
        ),
        inert=True,
    ),
    _mimic("of a hinge", '<mimic joint="shoulder"/>'),
    _mimic(
        "with multiplier and offset", '<mimic joint="shoulder" [[multiplier="-1.5" offset="0.4"]]/>'
    ),
    _mimic(
        "with friction",
        '<mimic joint="shoulder" multiplier="2"/>[[<dynamics damping="0.5" friction="0.3"/>]]',
    ),
    _mimic("of a joint farther out", '<mimic joint="wrist" multiplier="3"/>'),
    _mimic(
        "by two joints",
        '<mimic joint="shoulder"/>',
        _joint("fore", "revolute", '<mimic joint="shoulder" multiplier="0.5"/>'),
    ),
    _mimic(
        "of a mimic",
        '<mimic joint="shoulder" multiplier="0.5"/>',
        _joint("fore", "revolute", '<mimic joint="elbow" multiplier="2" offset="0.1"/>'),
    ),
    Entry(
        "URDF mimic of a continuous joint",
        arm(
            kinds=("continuous", "continuous", "prismatic"),
            axes=("0 0 1", "0 -1 0", "1 0 0"),
            elbow='<mimic joint="shoulder" multiplier="1" offset="0.2"/>',
        ),
    ),
    Entry(
        "URDF mimic of half a continuous joint",
        arm(
            kinds=("continuous", "revolute", "prismatic"),
            elbow='<mimic joint="shoulder" multiplier="[[0.5||1]]"/>',
        ),
    ),
    Entry(
        "URDF mimic of a fixed joint",
        arm(
            more=_joint("fore", "fixed")
            + _joint("hand", "revolute", '<mimic joint="extra" [[offset="0.7"]]/>', link="last")
        ),
    ),
    Entry("URDF mimic by a slide", arm(wrist='<mimic joint="elbow" multiplier="0.1"/>')),
    Entry(
        "URDF sidecar with the actuated joints",
        arm(elbow='<mimic joint="shoulder"/>'),
        sidecar='actuated = ["wrist", "shoulder"]\n',
    ),
)
