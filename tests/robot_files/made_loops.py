"""Closed chains as MJCF whose loop equations are more than their passive joints."""

import numpy as np

BAR = '<inertial mass="{}" pos="{} 0 0.01" fullinertia="0.02 0.05 0.06 0.002 0.001 -0.003"/>'


def turntable(closure='<connect site1="toe" site2="ground"/>', base=""):
    """A parallelogram in a plane that a turntable turns; the crank stands on the turntable."""
    return f"""<mujoco><compiler angle="radian"/><worldbody><body name="table" {base}>
      <joint name="yaw" axis="0 0 1"/>{BAR.format(5, 0.1)}<site name="ground" pos="0.7 0 0"/>
      <body name="crank" pos="0.1 0 0"><joint name="drive" axis="0 -1 0"/>{BAR.format(1, 0.2)}
        <body name="coupler" pos="0.4 0 0"><joint name="knee" axis="0 -1 0"/>{BAR.format(2, 0.3)}
          <body name="rocker" pos="0.6 0 0"><joint name="heel" axis="0 -1 0" damping="0.2"
            armature="0.1" stiffness="3" springref="0.2"/>{BAR.format(1.5, -0.2)}
            <site name="toe" pos="-0.4 0 0"/></body></body></body></body></worldbody>
      <equality>{closure}</equality>
      <actuator><motor joint="yaw"/><motor joint="drive"/></actuator>
      <keyframe><key name="home" qpos="0.3 0.7 -0.7 0.7"/></keyframe></mujoco>"""


def two_rockers(length=0.4):
    """A parallelogram of three equal cranks, one of which is redundant."""
    return f"""<mujoco><compiler angle="radian"/><worldbody><body name="base" euler="0.3 0.2 1">
      <site name="pin1" pos="0.3 0 0"/><site name="pin2" pos="0.6 0 0"/>
      <body name="crank"><joint name="drive" axis="0 -1 0"/>{BAR.format(1, 0.2)}
        <body name="coupler" pos="0.4 0 0"><joint name="knee" axis="0 -1 0"/>{BAR.format(2, 0.3)}
          <body name="rocker1" pos="0.3 0 0"><joint name="heel1" axis="0 -1 0"/>
            {BAR.format(1.5, -0.2)}<site name="toe1" pos="-{length} 0 0"/></body>
          <body name="rocker2" pos="0.6 0 0"><joint name="heel2" axis="0 -1 0" damping="0.2"/>
            {BAR.format(1, -0.1)}<site name="toe2" pos="-0.4 0 0"/></body>
        </body></body></body></worldbody>
      <equality><connect site1="pin1" site2="toe1"/><connect site1="toe2" site2="pin2"/></equality>
      <actuator><motor joint="drive"/></actuator>
      <keyframe><key name="home" qpos="1.5707963267948966 -1.5707963267948966 {{0}} {{0}}"/>
      </keyframe></mujoco>""".replace("{0}", "1.5707963267948966")


def bennett(closure="hinge"):
    """A Bennett linkage: four hinges in space that no general four hinges could be.

    Opposite links are equal and ``length / sin(twist)`` is that of both pairs [Bennett 1903]. Its
    last hinge is closed at two points of its line, or the link behind it is welded to the ground.
    """
    a = 0.4
    alpha = 0.5
    beta = 0.9
    b = a * np.sin(beta) / np.sin(alpha)
    first = 1.1
    second = 2 * np.arctan(
        np.sin((beta + alpha) / 2) / np.sin((beta - alpha) / 2) / np.tan(first / 2)
    )
    home = [first, second, -first, -second]
    line = (-b, 0.3 * np.sin(beta), 0.3 * np.cos(beta))
    hinge = '<connect site1="end" site2="pin"/><connect site1="end_up" site2="pin_up"/>'
    weld = '<weld site1="back" site2="start"/>'
    last = f"""<body name="link4"><joint name="j4" axis="0 0 1"/>{BAR.format(1, 0.1)}
      <site name="back" pos="{b} 0 0" euler="{beta} 0 0"/></body>"""
    count = 3 if closure == "hinge" else 4
    return f"""<mujoco><compiler angle="radian"/><worldbody>
      <body name="base" euler="0.4 0.3 0.2"><site name="pin" pos="{-b} 0 0"/><site name="start"/>
        <site name="pin_up" pos="{" ".join(map(repr, map(float, line)))}"/>
        <body name="link1"><joint name="j1" axis="0 0 1"/>{BAR.format(2, 0.1)}
          <body name="link2" pos="{a} 0 0" euler="{alpha} 0 0"><joint name="j2" axis="0 0 1"/>
            {BAR.format(1.5, 0.2)}
            <body name="link3" pos="{b} 0 0" euler="{beta} 0 0">
              <joint name="j3" axis="0 0 1" damping="0.3"/>{BAR.format(1, 0.1)}
              <body name="coupling" pos="{a} 0 0" euler="{alpha} 0 0"><site name="end"/>
                <site name="end_up" pos="0 0 0.3"/>{last if closure == "weld" else ""}</body>
      </body></body></body></body></worldbody>
      <equality>{hinge if closure == "hinge" else weld}</equality>
      <actuator><motor joint="j1"/></actuator>
      <keyframe><key name="home" qpos="{" ".join(map(repr, map(float, home[:count])))}"/></keyframe>
      </mujoco>"""
