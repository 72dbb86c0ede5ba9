"""What a URDF can say that changes the dynamics: a table of variants, as `variants_mjcf`."""

_INERTIA = 'ixx="0.02" ixy="0.004" ixz="-0.003" iyy="0.09" iyz="0.002" izz="0.08"'
LINK = f'<inertial><origin xyz="0.2 0.03 -0.05"/><mass value="3"/><inertia {_INERTIA}/></inertial>'
TOOL = (
    '<inertial><origin xyz="0.02 0.07 0.03"/><mass value="0.6"/>'
    '<inertia ixx="0.003" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.004"/></inertial>'
)
_LIMIT = '<limit lower="-9" upper="9" effort="10" velocity="5"/>'


def _axis(xyz):
    return f'<axis xyz="{xyz}"/>' if xyz else ""


def arm(
    *,
    base="",
    shoulder="",
    elbow="",
    wrist="",
    kinds=("revolute", "revolute", "prismatic"),
    axes=("0.2 -1 0.3", "0 1 0", "1 0.5 0"),
    place='<origin xyz="0.4 0.05 -0.1" rpy="0.2 0.3 -0.4"/>',
    upper=LINK,
    fore=LINK,
    hand=TOOL,
    more="",
    limit=_LIMIT,
):
    """Return an arm of three joints; each argument goes where its name says."""
    names = ("shoulder", "elbow", "wrist")
    places = ('<origin xyz="0.1 -0.2 0.4"/>', place, '<origin xyz="0.3 -0.02 0.04"/>')
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


def _joint(parent, kind, more="", *, link="extra"):
    return (
        f'<link name="{link}">{TOOL}</link><joint name="{link}" type="{kind}"><parent '
        f'link="{parent}"/><child link="{link}"/><origin xyz="0 0.2 0.1" rpy="0.5 0 1"/>'
        f'<axis xyz="0 1 1"/>{_LIMIT}{more}</joint>'
    )


#: By what makes the robot of a text: the texts.
READ = {
    lambda x: arm(kinds=("revolute", x[0], "prismatic"), axes=("0.2 -1 0.3", x[1], "1 0.5 0")): (
        ("revolute", "0 3 4"),
        ("revolute", "0.57735 0.57735 0.57735"),
        ("revolute", ""),
        ("continuous", "-1 0 0"),
        ("continuous", "0 0 1"),
        ("continuous", "0.36 -0.48 0.8"),
        ("continuous", "1 0 4.9e-12"),
        ("prismatic", "0 0 -1"),
        ("prismatic", "0.36 -0.48 0.8"),
        ("fixed", "0 0 1"),
    ),
    lambda x: arm(place=f"<origin {x}/>"): (
        'xyz="0.4 0.05 -0.1"',
        'xyz="0.4 0 0" rpy="0.3 -0.4 2"',
        'xyz="0.4 0 0" rpy="0.3 1.5707963267948966 2"',
    ),
    lambda x: arm(fore=x): (
        "",
        LINK.replace('-0.05"', '-0.05" rpy="0.3 -0.4 2"'),
        LINK + '<visual><geometry><mesh filename="package://arm/no.stl"/></geometry></visual>'
        '<collision><geometry><sphere radius="1"/></geometry></collision>',
    ),
    lambda x: arm(hand=TOOL.replace('"0.6"', x)): ('"0"',),
    lambda x: arm(base=LINK, limit=x): ("",),
    lambda x: arm(more=x): (
        '<link name="world"/><joint name="mount" type="fixed"><parent link="world"/><child '
        'link="base"/><origin xyz="1 2 3" rpy="3.14159265358979 0 0.4"/></joint>',
        _joint("fore", "fixed") + _joint("extra", "fixed", link="last"),
        _joint("fore", "fixed") + _joint("extra", "revolute", link="last"),
        _joint("upper", "revolute", link="side"),
        _joint("fore", "fixed")
        + _joint("hand", "revolute", '<mimic joint="extra" offset="0.7"/>', link="last"),
        '<gazebo reference="fore"><kp>1</kp></gazebo><ros2_control name="c" type="system"/>'
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint '
        'name="elbow"/><actuator name="m"><mechanicalReduction>50</mechanicalReduction>'
        "</actuator></transmission>",
    ),
    lambda x: arm(kinds=("revolute", x, "prismatic"),
                  elbow='<dynamics damping="0.7" friction="0.4"/>'): ("revolute", "continuous"),
    lambda x: arm(elbow=f"<mimic {x}/>"): (
        'joint="shoulder" multiplier="-1.5" offset="0.4"',
        'joint="shoulder" multiplier="2"/><dynamics damping="0.5" friction="0.3"',
        'joint="wrist" multiplier="3"',
    ),
    lambda x: arm(elbow='<mimic joint="shoulder" multiplier="0.5"/>',
                  more=_joint("fore", "revolute", f"<mimic {x}/>")): (
        'joint="shoulder" multiplier="0.5"',
        'joint="elbow" multiplier="2" offset="0.1"',
    ),
    lambda x: arm(wrist=f"<mimic {x}/>"): ('joint="elbow" multiplier="0.1"',),
    lambda x: arm(kinds=("continuous", x[0], "prismatic"), axes=("0 0 1", "0 -1 0", "1 0 0"),
                  elbow=f'<mimic joint="shoulder" multiplier="{x[1]}" offset="0.2"/>'): (
        ("continuous", 1),
        ("revolute", 0.5),
    ),
}  # fmt: skip

#: The same for what is refused: a word of the sentence, and the texts.
REFUSED = {
    lambda x: arm(kinds=("revolute", x, "prismatic"), axes=("1 0 0", "0 0 1", "1 0 0")): {
        "floating": "actuat",
        "planar": "planar",
    },
    lambda x: arm(axes=("1 0 0", x, "1 0 0")): {"0 0 0": "axis"},
}
