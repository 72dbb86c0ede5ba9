"""The two-link arm with servos, and what its joints have beside its file."""

import shutil
from pathlib import Path

import servo_robots as servos

from identifiability import Log, Robot
from identifiability.logs.conventions import Conventions

MODELS = Path(__file__).resolve().parents[1] / "models"
SIDECAR = """
name = "Arm with servos"
[servo]
kp = {shoulder = 1200, "elb*" = 300}
kv = {shoulder = 50, "*" = 8}
limit = 900
lag = 0
speed_lag = 0
"""
TRUTH = {
    **{"shoulder.Ia": 0.11, "shoulder.Fv": 2.0, "shoulder.Fc": 1.1, "shoulder.off": 0.8},
    **{"elbow.Ia": 0.05, "elbow.Fv": 0.9, "elbow.Fc": 0.5, "elbow.off": -0.4},
}


def load_arm(folder, sidecar=SIDECAR):
    """Write the arm and a sidecar into a folder, and read them."""
    shutil.copy(Robot.load("two-link").path, folder / "arm.xml")
    (folder / "arm.toml").write_text(sidecar)
    return Robot.load(folder / "arm.xml")


def draw(robot, seconds, size, how, rng, truth=TRUTH, *more):
    """Record drawn commands of a robot."""
    moves = servos.draw_commands(robot, seconds, how.command_rate, size, rng)
    return servos.record(robot, truth, moves, seconds, how, rng, *more)


def read(robot, frame):
    """Return a log of a robot, in its order of joints."""
    return Log.from_frame(frame, conventions=Conventions.of(robot)).select(robot.joints)
