"""The same robot in the other format: an MJCF of a URDF, a URDF of an MJCF.

It is written from what is known of the robot (joints, their places, loops, couplings), not from the
text of its file: no geometry, so a simulator shows nothing and nothing collides.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.output import write_text
from identifiability.robot.description import Description
from identifiability.robot.twin_mjcf import twin_mjcf
from identifiability.robot.twin_sidecar import twin_sidecar
from identifiability.robot.twin_urdf import twin_urdf


def write_twin(robot: Description, path: Path) -> None:
    """Write a robot in another format, with placeholders for its inertias, and its sidecar.

    Parameters
    ----------
    robot : Description
    path : Path
        ``.xml`` for MJCF, ``.urdf`` for URDF.

    Raises
    ------
    RobotError
        If the format cannot hold it, or nothing here can write it.
    """
    _check(robot, path)
    top = twin_mjcf(robot) if path.suffix == ".xml" else twin_urdf(robot)
    ET.indent(top)
    write_text(path, ET.tostring(top, encoding="unicode") + "\n")
    write_text(path.with_suffix(".toml"), toml_text(twin_sidecar(robot, path)))


def _check(robot: Description, path: Path) -> None:
    word = "MJCF" if path.suffix == ".xml" else "URDF"
    own = "MJCF" if robot.mjcf else "URDF"
    if robot.cables:
        raise RobotError(
            f"{robot.path} has tendons between bodies ({listing([t.name for t in robot.cables])}), "
            f"which cannot be written as {word}: export it as {own}, or as JSON."
        )
    odd = [j.dofs[0].rpartition(".")[0] for j in robot.tree.joints if j.nv > 1]
    if odd:
        raise RobotError(
            f"{robot.path} has joints that turn every way ({listing(odd, 4)}), which cannot be "
            f"written as {word}: export it as {own}, or as JSON."
        )
