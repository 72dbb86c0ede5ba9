"""Write robot.xml: the 3-RPS robot of the paper, in the paper's frames (SOURCE.md has the numbers).

Run ``python models/3-rps/make_robot.py`` after a change of geometry; the file beside it is its
output. It exists because the home keyframe must close the loops to machine precision.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

BASE_RADIUS = 0.40  # [m] circle of the revolute joints A1..A3
EDGE = 0.4563  # [m] edge of the platform triangle B1 B2 B3
HOME_LENGTH = 0.70  # [m] |A_i B_i| at home
PLATFORM_RADIUS = EDGE / np.sqrt(3)

LOWER = (
    '<inertial mass="3" pos="0 0.1 0" fullinertia="0.018633 0.0024 0.018633 0 0 0"/>'
    '<geom type="capsule" fromto="0 0 0 0 0.4 0" size="0.03" mass="0" group="1"'
    ' contype="0" conaffinity="0"/>'
)
UPPER = (
    '<inertial mass="2" pos="0 0 -0.2" fullinertia="0.026867 0.026867 0.0004 0 0 0"/>'
    '<geom type="capsule" fromto="0 0 -0.5 0 0 0" size="0.015" mass="0" group="1"'
    ' contype="0" conaffinity="0"/>'
)


def numbers(values: object) -> str:
    """Format numbers with all their digits."""
    return " ".join(f"{x:.17g}" for x in np.atleast_1d(np.asarray(values, float)))


def platform() -> str:
    """Return the platform body: frame origin B1, x towards B2, y towards B3 in its plane."""
    turn = np.deg2rad(150.0)  # the direction B1 -> B2 seen from the frame of the first leg
    axes = [np.cos(turn), np.sin(turn), 0, -np.sin(turn), np.cos(turn), 0]
    mass, radius = 10.248, 0.30
    centre = [EDGE / 2, EDGE / (2 * np.sqrt(3)), 0]
    disc = [mass * radius**2 / 4, mass * radius**2 / 4, mass * radius**2 / 2, 0, 0, 0]
    return f"""
          <body name="platform" xyaxes="{numbers(axes)}">
            <joint name="ball1_x" axis="1 0 0"/>
            <joint name="ball1_y" axis="0 1 0"/>
            <joint name="ball1_z" axis="0 0 1"/>
            <inertial mass="{mass}" pos="{numbers(centre)}" fullinertia="{numbers(disc)}"/>
            <geom type="cylinder" pos="{numbers(centre)}" size="{radius} 0.01" mass="0" group="1"
                  contype="0" conaffinity="0"/>
            <site name="platform_B2" pos="{EDGE} 0 0"/>
            <site name="platform_B3" pos="{numbers([EDGE / 2, EDGE * np.sqrt(3) / 2, 0])}"/>
          </body>"""


def leg(index: int) -> str:
    """Return leg 1, 2 or 3: revolute axis tangent to the base circle, slide along the leg."""
    azimuth = 2 * np.pi * (index - 1) / 3
    outward = np.array([np.cos(azimuth), np.sin(azimuth), 0])
    child = platform() if index == 1 else ""
    return f"""
      <body name="leg{index}_lower" pos="{numbers(BASE_RADIUS * outward)}"
            xyaxes="{numbers(outward)} 0 0 1">
        <joint name="hinge{index}" axis="0 0 1" range="-0.3 0.9"/>
        {LOWER}
        <body name="leg{index}_upper" xyaxes="1 0 0 0 0 -1">
          <joint name="slider{index}" type="slide" axis="0 0 1" range="0.55 0.85"
                 damping="3272" frictionloss="228" armature="483.1"/>
          {UPPER}
          <site name="leg{index}_B{index}"/>{child}
        </body>
      </body>"""


def main() -> None:
    """Write robot.xml beside this script."""
    lean = np.arcsin((BASE_RADIUS - PLATFORM_RADIUS) / HOME_LENGTH)
    # The platform is level at home: its hinges undo the lean of leg 1, whose axis is -y there;
    # in the platform's own frame (turned by 150 deg about z) that is a rotation about two axes.
    home = solve_home(lean)
    text = f"""<mujoco model="3-rps">
  <!-- 3-RPS parallel robot of Díaz-Rodríguez, Mata, Farhat and Provenzano. SI units, radians.
       Written by make_robot.py. Frames as in the paper's Table 1:
       legN_lower: origin A_N, z the revolute axis, y along the leg;
       legN_upper: origin B_N, z along the leg; sliderN is the full leg length |A_N B_N|;
       platform: origin B1, x towards B2, B3 in the half plane y > 0. -->
  <compiler angle="radian" autolimits="true"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="base">{leg(1)}{leg(2)}{leg(3)}
    </body>
  </worldbody>
  <equality>
    <connect name="closure2" site1="platform_B2" site2="leg2_B2"/>
    <connect name="closure3" site1="platform_B3" site2="leg3_B3"/>
  </equality>
  <actuator>
    <motor name="motor1" joint="slider1"/>
    <motor name="motor2" joint="slider2"/>
    <motor name="motor3" joint="slider3"/>
  </actuator>
  <keyframe>
    <key name="home" qpos="{numbers(home)}"/>
  </keyframe>
</mujoco>
"""
    Path(__file__).with_name("robot.xml").write_text(text, encoding="utf-8")


def solve_home(lean: float) -> list[float]:
    """Return the joint angles at home; the platform hinges take out the lean of leg 1."""
    turn = np.deg2rad(150.0)
    c, s = np.cos(turn), np.sin(turn)
    fixed = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    # The hinge turns leg 1 by +lean about e x z = -y of the level frame: undo it.
    back = np.array(
        [
            [np.cos(lean), 0, np.sin(lean)],
            [0, 1, 0],
            [-np.sin(lean), 0, np.cos(lean)],
        ]
    )
    rotation = fixed.T @ back @ fixed  # = Rx(a) Ry(b) Rz(c)
    b = np.arcsin(rotation[0, 2])
    a = np.arctan2(-rotation[1, 2], rotation[2, 2])
    g = np.arctan2(-rotation[0, 1], rotation[0, 0])
    return [lean, HOME_LENGTH, a, b, g, lean, HOME_LENGTH, lean, HOME_LENGTH]


if __name__ == "__main__":
    main()
