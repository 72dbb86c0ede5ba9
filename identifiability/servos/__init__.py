"""Commanded robots: torque from commands and servo gains, and servo numbers from rollouts.

This is the one door of the room: other rooms import from here alone. `torque` computes the torque
of servos from their commands. `rollouts` fits joints, bodies, delays and gains to measured
positions, by the search of `problem`, which begins at `start`. `gains` states the gains.
`odd_joints` names play, wrong gains and limits, `standing` the effect that holds joints at rest.
`contacts` leaves out joints that something outside the robot holds. `calibration` subtracts the
error of recording from the torque. `follow` does all of this for the logs of a verb.

It imports MuJoCo, so verbs import it inside functions.
"""

from __future__ import annotations

from identifiability.simulation.rollout import forgotten

from .calibration import calibrate_torque, roll_delayed
from .contacts import leave_out_blocked
from .first_answer import FirstAnswer
from .fit import fit_rollouts, follows_better
from .follow import delay_commands, follow_commands
from .gains import file_shares, learn_gains, select_commanded, state_gains
from .odd_joints import find_odd_joints
from .positions import rms_of_judged
from .rollouts import Rollouts
from .standing import state_standing
from .start import settle_joints
from .torque import compute_torque, replace_servo, servo_log
from .windows import moving_commands

__all__ = [
    "FirstAnswer",
    "Rollouts",
    "calibrate_torque",
    "compute_torque",
    "delay_commands",
    "file_shares",
    "find_odd_joints",
    "fit_rollouts",
    "follow_commands",
    "follows_better",
    "forgotten",
    "learn_gains",
    "leave_out_blocked",
    "moving_commands",
    "replace_servo",
    "rms_of_judged",
    "roll_delayed",
    "select_commanded",
    "servo_log",
    "settle_joints",
    "state_gains",
    "state_standing",
]
