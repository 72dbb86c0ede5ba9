"""Robots in MJCF to which the entries of the corpus add one feature each.

No mass lies on a joint's axis and no axis along a coordinate axis where it matters: a value that
is read wrongly then shows in the torque.
"""

import math

UPPER = '<inertial pos="0.2 0.03 -0.05" mass="3" fullinertia="0.02 0.09 0.08 0.004 -0.003 0.002"/>'
FORE = (
    '<inertial pos="0.15 -0.04 0.06" mass="1.7" fullinertia="0.01 0.04 0.035 -0.002 0.001 0.003"/>'
)
HAND = (
    '<inertial pos="0.02 0.07 0.03" mass="0.6" '
    'fullinertia="0.003 0.002 0.004 0.0002 0.0001 0.0003"/>'
)
GEOM = '<geom type="box" size="0.15 0.04 0.06" pos="0.1 0.02 -0.03" contype="0" conaffinity="0"/>'
HANDLE = (
    '<geom type="ellipsoid" size="0.05 0.03 0.08" pos="0.02 0.05 0.01" contype="0" '
    'conaffinity="0"/>'
)

#: Motors for the joints of `arm`.
MOTORS = (
    '<actuator><motor joint="shoulder"/><motor joint="elbow"/><motor joint="wrist"/></actuator>'
)


def arm(
    top="",
    after="",
    *,
    world="",
    base="",
    in_base="",
    upper='pos="0.1 -0.2 0.4"',
    in_upper=UPPER,
    shoulder='axis="0.2 -1 0.3"',
    fore='pos="0.4 0.05 -0.1"',
    in_fore=FORE,
    elbow='axis="0 1 0"',
    hand='pos="0.3 -0.02 0.04"',
    in_hand=HAND,
    wrist='type="slide" axis="1 0.5 0"',
):
    """Return an arm of two hinges and a slide; each argument goes where its name says."""
    return f"""<mujoco model="arm">
{top}
<worldbody>
  {world}
  <body name="base" {base}>
    {in_base}
    <body name="upper" {upper}>
      {in_upper}
      <joint name="shoulder" {shoulder}/>
      <body name="fore" {fore}>
        {in_fore}
        <joint name="elbow" {elbow}/>
        <body name="hand" {hand}>
          {in_hand}
          <joint name="wrist" {wrist}/>
        </body>
      </body>
    </body>
  </body>
</worldbody>
{after}
</mujoco>
"""


#: The crank upright, and the angles that close the chain there.
HOME = "1.5707963267948966 -1.26754214 -1.54996149"


def four_bar(
    top="",
    equality='<connect site1="tip" site2="pin"/>',
    *,
    after="",
    base="",
    in_base='<body name="post" pos="0.6 0 0"><site name="pin" pos="0.1 0 0"/></body>',
    in_rod="",
    crank="",
    rod="",
    rocker="",
    world="",
    upright=False,
):
    """Return a crank, a rod and a rocker between two points of the base, 0.7 m apart.

    Crank 0.2 m, rod 0.6 m, rocker 0.4 m: the crank can turn all the way round. Where `upright`,
    the chain is closed at zero; else it is stretched there, and a keyframe closes it.
    """
    turns = [f'euler="0 {-float(x)} 0"' if upright else "" for x in HOME.split()]
    home = f'<keyframe><key name="home" qpos="{HOME}"/></keyframe>'
    return f"""<mujoco model="four-bar">
<compiler angle="radian"/>
{top}
<default><joint axis="0 -1 0"/></default>
<worldbody>
  {world}
  <body name="base" {base}>
    {in_base}
    <body name="crank" {turns[0]}>
      <inertial pos="0.1 0.01 0.02" mass="1.2" diaginertia="0.001 0.006 0.006"/>
      <joint name="crank" {crank}/>
      <body name="rod" pos="0.2 0 0" {turns[1]}>
        <inertial pos="0.3 -0.01 0.05" mass="1.5" diaginertia="0.002 0.05 0.05"/>
        <joint name="rod" {rod}/>
        {in_rod}
        <body name="rocker" pos="0.6 0 0" {turns[2]}>
          <inertial pos="0.15 0.01 -0.03" mass="0.9" diaginertia="0.001 0.02 0.02"/>
          <joint name="rocker" {rocker}/>
          <site name="tip" pos="0.4 0 0"/>
        </body>
      </body>
    </body>
  </body>
</worldbody>
<equality>{equality}</equality>
<actuator><motor joint="crank"/></actuator>
{"" if upright else home}
{after}
</mujoco>
"""


def ball_wrist():
    """Return a plate on a ball that three cranks turn, each by a rod on a universal joint."""
    legs = ""
    anchors = ""
    motors = ""
    for k in range(3):
        turn = 2 * math.pi * k / 3 + 0.1
        legs += f"""<body name="crank{k}" euler="0 0 {turn}" pos="{0.2 * math.cos(turn)}
          {0.2 * math.sin(turn)} 0"><inertial pos="0.03 0.02 0" mass="0.5" diaginertia="0.001 0.002
          0.002"/><joint name="motor{k}" axis="1 0 0"/><body name="rod{k}" pos="0 0.07 -0.07">
          <inertial pos="0 0.01 0.2" mass="0.3" diaginertia="0.003 0.002 0.001"/><joint
          name="tilt{k}" axis="1 0 0"/><joint name="sway{k}" axis="0 1 -1"/></body></body>"""
        anchors += f'<connect body1="rod{k}" body2="plate" anchor="0 0.25 0.25"/>'
        motors += f'<motor joint="motor{k}"/>'
    return f"""<mujoco model="ball-wrist"><compiler angle="radian"/><worldbody><body name="base">
{legs}<body name="plate" pos="0 0 0.35"><inertial pos="0.01 0.02 0.1" mass="2" diaginertia="0.03
0.02 0.04"/><joint name="ball" type="ball"/></body></body></worldbody>
<equality>{anchors}</equality><actuator>{motors}</actuator></mujoco>
"""
