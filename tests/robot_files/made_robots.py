"""Small robots as MJCF: an arm and a parallelogram, with what a test puts into them."""

LINKS = """
  <body name="base" {base}>
    <body name="link1" {link1}>
      <inertial mass="4" pos="0.3 0.02 0.01" diaginertia="0.03 0.1 0.11"/>
      <joint name="shoulder" axis="0 -1 0" {shoulder}/>
      <body name="link2" pos="0.5 0 0" {link2}>
        <inertial mass="2" pos="0.2 0 0.03" fullinertia="0.02 0.05 0.06 0.002 0.001 -0.003"/>
        <joint name="elbow" axis="0 -1 0" {elbow}/>{inside}
      </body>
    </body>{beside}
  </body>"""
MOTORS = '<actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>'


def arm(before="", after="", compiler="", worldbody=LINKS, actuator=MOTORS, **parts):
    words = dict.fromkeys(("base", "link1", "link2", "shoulder", "elbow", "inside", "beside"), "")
    body = worldbody.format(**{**words, **parts})
    return (
        f'<mujoco><compiler angle="radian" {compiler}/>{before}<worldbody>{body}</worldbody>'
        f"{actuator}{after}</mujoco>"
    )


def parallelogram(closure, base="", home="0.7 -0.7", sites=""):
    """A parallelogram in a vertical plane whose driven crank stands on the base."""
    return f"""<mujoco><compiler angle="radian"/><worldbody>{{0}}<body name="base" {base}>
      <site name="ground" pos="0.6 0 0"/><body name="fixed" pos="0.6 0 0"><site name="foot"/></body>
      <body name="crank"><joint name="drive" axis="0 -1 0"/>
        <inertial mass="1" pos="0.2 0 0" diaginertia="0.01 0.02 0.02"/>
        <body name="coupler" pos="0.4 0 0"><joint name="knee" axis="0 -1 0"/>
          <inertial mass="2" pos="0.3 0 0" diaginertia="0.01 0.05 0.05"/>
          <body name="rocker" pos="0.6 0 0"><joint name="heel" axis="0 -1 0" damping="0.2"
             armature="0.1" stiffness="3" springref="0.2"/>
            <inertial mass="1.5" pos="-0.2 0 0" diaginertia="0.01 0.02 0.02"/>
            <site name="toe" pos="-0.4 0 0"/></body></body></body></body></worldbody>
      <equality>{closure}</equality><actuator><motor joint="drive"/></actuator>
      <keyframe><key name="home" qpos="{home} 0.7"/></keyframe></mujoco>""".replace("{0}", sites)


CLOSURES = {
    "site on the root": '<connect site1="toe" site2="ground"/>',
    "site on the root, first": '<connect site1="ground" site2="toe"/>',
    "site in a static body": '<connect site1="foot" site2="toe"/>',
    "site on the world": '<connect site1="toe" site2="w"/>',
}

WRIST = """<body name="wrist" pos="0.2 0 0"><joint name="w" axis="0 1 0" {w}/>
  <inertial mass="0.7" pos="0.1 0.02 0" diaginertia="0.003 0.004 0.005"/>
  <body name="tip" pos="0.1 0 0"><joint name="p" type="slide" axis="1 0 0.2"/>
  <inertial mass="0.3" pos="0.05 0 0.02" diaginertia="0.001 0.002 0.002"/></body></body>"""
TENDONS = """<tendon><fixed name="one"><joint joint="w" coef="2"/><joint joint="elbow" coef="-0.6"/>
  </fixed><fixed name="two"><joint joint="elbow" coef="0.4"/></fixed>
  <fixed name="both"><joint joint="shoulder" coef="0.7"/><joint joint="elbow" coef="0.4"/>
  </fixed></tendon><equality>{}</equality>"""
EQUALITY = '<tendon tendon1="one" tendon2="two" polycoef="0.1 0.5 0.2 -0.1 0.05"/>'
SLIDE = '<joint joint1="p" joint2="w" polycoef="0 0.2 0.1 0 0"/>'


def coupled(equality=EQUALITY + SLIDE, w="", **parts):
    return arm(inside=WRIST.format(w=w), after=TENDONS.format(equality), **parts)


#: A tendon over both joints of the arm, and one through the loop of the parallelogram.
NUMBERS = 'stiffness="9" springlength="0.2" damping="1.1" armature="0.3" frictionloss="0.7"'
CABLE = (
    f'<tendon><fixed name="cable" {NUMBERS}><joint joint="shoulder" coef="1.3"/>'
    '<joint joint="elbow" coef="-0.5"/></fixed></tendon>'
)
LOOP_CABLE = (
    f'<tendon><fixed name="cable" {NUMBERS}><joint joint="drive" coef="1.3"/>'
    '<joint joint="heel" coef="-0.5"/><joint joint="knee" coef="0.4"/></fixed></tendon></mujoco>'
)


#: What a link of a URDF weighs.
INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def turning(inside="", head="", tail="", joint="j", mass="1"):
    """Return an MJCF of one body that turns."""
    inertial = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>'
    body = f'<body name="b"><joint name="{joint}"/>{inertial}{inside}</body>'
    return f"<mujoco>{head}<worldbody>{body}</worldbody>{tail}</mujoco>"
