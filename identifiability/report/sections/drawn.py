"""The robot beside the answers, coloured by what a page is about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Sketch
from identifiability.report.figures.skeleton import Part, draw_skeleton, trace_limbs
from identifiability.report.marks import mark_of
from identifiability.report.numbers import join
from identifiability.report.words import sentence
from identifiability.robot import Robot

#: Verdicts by what the drawing prefers to show of a body that has several.
BEST = (Class.IDENTIFIABLE, Class.WEAK, Class.NEGLIGIBLE, Class.NOT_JUDGED)

#: Poses that the drawn one is chosen from.
POSES = 24

#: How far a joint without limits is turned or moved for the drawing [rad, m].
REACH = (1.0, 0.2)


def sketch_robot(
    robot: Robot, samples: Sequence[Prepared], verdicts: Sequence[Verdict]
) -> Sketch | None:
    """Return the robot drawn in the middle of its motion, coloured by what is identifiable."""
    owners: dict[str, list[Verdict]] = {}
    for v in verdicts:
        owners.setdefault(v.name.rpartition(".")[0], []).append(v)
    parts = {owner: _part(each) for owner, each in owners.items()}
    pose = moved_pose(robot, samples)
    return sketch_parts(robot, parts, "decision.drawing", pose, "does not appear in the model")


def sketch_parts(
    robot: Robot,
    parts: Mapping[str, Part],
    caption: str,
    pose: Array | None = None,
    rest: str = "",
) -> Sketch | None:
    """Return the robot drawn with some parts coloured.

    None where it has no extent to draw, as of joints that all lie in one point.

    Parameters
    ----------
    robot : Robot
    parts : mapping
        Body or joint to how it is shown.
    caption : str
        Which of the words say what the colours are.
    pose : (nq,), optional
        By default one that it could take.
    rest : str
        What is said of bodies that are none of the parts.
    """
    drawing = draw_skeleton(robot, typical_pose(robot) if pose is None else pose, parts, rest)
    return None if drawing is None else Sketch(drawing, 400, sentence(caption))


def moved_pose(robot: Robot, samples: Sequence[Prepared]) -> Array:
    """Return the pose in the motion, (nq,), in which the robot is least like a line."""
    if not samples or not samples[0].survey.kept:
        return robot.home
    motion = samples[0].thin(max(1, samples[0].survey.kept // POSES)).motion
    return widest_pose(robot, motion.q)


def actuated_pose(robot: Robot, q: Array) -> Array:
    """Return a pose (nq,) of some that actuated positions (N, n) stand for.

    Only an open chain knows all of it from these; a closed one is drawn at home.
    """
    if robot.closed or not len(q) or not np.isfinite(q).all():
        return robot.home
    return widest_pose(robot, robot.configuration(q[:: max(1, len(q) // POSES)]))


def typical_pose(robot: Robot) -> Array:
    """Return a pose within the limits, (nq,), for who has no motion; of a closed chain home."""
    slides = [int(robot.is_prismatic(int(k))) for k in robot.actuated]
    home = robot.actuated_positions(robot.home[None])[0]
    far = np.array(REACH)[slides]
    low, high = np.clip(robot.limits, (home - far)[:, None], (home + far)[:, None]).T
    rng = np.random.default_rng(0)
    return actuated_pose(robot, rng.uniform(low, np.maximum(low, high), (POSES, len(home))))


def widest_pose(robot: Robot, poses: Array) -> Array:
    """Return the one of some poses (N, nq) in which the robot is least like a line."""
    width = [
        np.linalg.svd(p - p.mean(0), compute_uv=False)[1] if len(p) > 1 else 0.0
        for p in (trace_limbs(robot, q)[1] for q in poses)
    ]
    pose: Array = poses[int(np.argmax(width))] if width else robot.home
    return pose


def _part(verdicts: Sequence[Verdict]) -> Part:
    kinds = [v.verdict for v in verdicts]
    best = next((c for c in BEST if c in kinds), kinds[0])
    counts = [f"{kinds.count(k)} {k.value}" for k in dict.fromkeys(kinds)]
    return Part(mark_of(best.value).tone, join(counts))
