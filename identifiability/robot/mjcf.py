"""Compile an MJCF with MuJoCo, whose reading of the file is the reference.

What carries no inertia (looks, sensors, contact pairs, meshes of bodies that state their inertia)
is taken out first, so that its files need not be there.
"""

from __future__ import annotations

import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import RobotError, near_match
from identifiability.robot.bounded_xml import check_regular, check_weight
from identifiability.robot.markup import file_text, read_markup

_GEOM, _FROM = mujoco.mjtGeom, mujoco.mjtInertiaFromGeom
_FILED = (int(_GEOM.mjGEOM_MESH), int(_GEOM.mjGEOM_HFIELD), int(_GEOM.mjGEOM_SDF))


def compile_mjcf(path: Path, root: ET.Element, outside: Collection[str] = ()) -> Any:
    """Return the compiled model (mujoco.MjModel) of an MJCF; what has no name is given one.

    Parameters
    ----------
    path : Path
    root : Element
        What `read_markup` made of the file.
    outside : collection of str
        Bodies to leave out, with all that hangs on them and refers to them.

    Raises
    ------
    RobotError
        With MuJoCo's reason, and the near match of a name that is not there.
    """
    with _refused(path, root):
        spec = _parse(path, root)
        leave_out(spec, outside)
        return spec.compile()


def leave_out(spec: Any, outside: Collection[str]) -> None:
    """Name all bodies and joints, and delete some bodies with all that refers to them."""
    _name_all(spec)
    for name in outside:
        spec.delete(spec.body(name))


def weighing_files(path: Path) -> tuple[Path, ...]:
    """Return the files of meshes from which an MJCF takes inertias.

    Raises
    ------
    RobotError
    """
    root = read_markup(path)
    with _refused(path, root):
        return _mesh_files(path, _parse(path, root))


def _mesh_files(path: Path, spec: Any) -> tuple[Path, ...]:
    folder = path.parent / (spec.compiler.meshdir or "")
    return tuple(folder / mesh.file for mesh in spec.meshes if mesh.file)


def _parse(path: Path, root: ET.Element) -> Any:
    spec = mujoco.MjSpec.from_string(file_text(path, root))
    spec.modelfiledir = str(path.parent)
    _take_out_idle(spec)
    _check_meshes(path, spec)
    return spec


def _check_meshes(path: Path, spec: Any) -> None:
    for file in _mesh_files(path, spec):
        check_regular(file)
        check_weight(path, [file])


def compile_shapes(path: Path, root: ET.Element) -> Any:
    """Return an MJCF compiled with the geoms that collide and no others.

    Raises
    ------
    RobotError
    """
    with _refused(path, root):
        spec = mujoco.MjSpec.from_string(file_text(path, root))
        spec.modelfiledir = str(path.parent)
        _name_all(spec)
        for geom in list(spec.geoms):
            if not (geom.contype or geom.conaffinity):
                spec.delete(geom)
        _forget_looks(spec)
        _check_meshes(path, spec)
        # Bodies without shapes weigh nothing here, which is nobody's concern.
        spec.compiler.boundmass, spec.compiler.boundinertia = 1e-6, 1e-9
        return spec.compile()


@contextmanager
def _refused(path: Path, root: ET.Element) -> Iterator[None]:
    """Give MuJoCo's reasons as ours."""
    try:
        with quiet():
            yield
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        raise RobotError(f"{path} cannot be read as MJCF: {_reason(error, root)}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo's warnings off the screen and out of log files in the user's folder."""
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(None)


def _reason(error: Exception, root: ET.Element) -> str:
    """Return MuJoCo's reason on one line, with its full stop."""
    lines = [" ".join(line.split()) for line in str(error).splitlines() if line.strip()]
    reason = re.sub(r"^((XML )?Error: )+", "", lines[0]).rstrip(".") if lines else "it is refused"
    place = re.sub(r"Element name '', |id -?\d+, ", "", lines[1]) if len(lines) > 1 else ""
    text = f"{reason} ({place[0].lower()}{place[1:]})" if place else reason
    known = {e.get(key) or "" for e in root.iter() for key in ("name", "class")}
    known |= {"hinge", "slide", "ball", "free"}
    quoted = re.search(r"'([^']+)'", reason)
    if quoted is None or quoted[1] in known or reason.startswith("Schema"):
        return f"{text[:300]}."
    return text[:300] + near_match(quoted[1], known)


def _take_out_idle(spec: Any) -> None:
    """Remove what has no share in the motion, above all what would be read from other files."""
    idle = (spec.sensors, spec.pairs, spec.excludes, spec.tuples, spec.skins, spec.lights)
    for element in [e for kind in idle for e in kind]:
        spec.delete(element)
    for body in spec.bodies:
        moves = _moves(body) or spec.compiler.settotalmass > 0
        for geom in list(body.geoms):
            filed = geom.meshname or geom.hfieldname or int(geom.type) in _FILED
            if filed and not (moves and _weighs(spec.compiler, body, geom)):
                spec.delete(geom)
    _forget_looks(spec)


def _forget_looks(spec: Any) -> None:
    """Remove materials, and the assets that nothing uses."""
    geoms, sites = list(spec.geoms), list(spec.sites)  # each look at them takes a while
    for element in (*geoms, *sites, *spec.tendons, *spec.meshes):
        element.material = ""
    used = {e.meshname for e in (*geoms, *sites)} | {f.name for f in spec.flexes}
    meshes = [m for m in spec.meshes if m.name not in used]
    heights = {g.hfieldname for g in geoms}
    fields = [h for h in spec.hfields if h.name not in heights]
    for asset in (*spec.materials, *spec.textures, *meshes, *fields):
        spec.delete(asset)


def _moves(body: Any) -> bool:
    return bool(body.joints) or (body.parent is not None and _moves(body.parent))


def _weighs(compiler: Any, body: Any, geom: Any) -> bool:
    """Whether the inertia of a body comes from this geom too."""
    how, low_high = int(compiler.inertiafromgeom), compiler.inertiagrouprange
    stated = body.explicitinertial and how != int(_FROM.mjINERTIAFROMGEOM_TRUE)
    if stated or how == int(_FROM.mjINERTIAFROMGEOM_FALSE):
        return False
    given = geom.density if np.isnan(geom.mass) else geom.mass
    return bool(given and low_high[0] <= geom.group <= low_high[1])


def _name_all(spec: Any) -> None:
    """Give bodies and joints without a name one that is not taken."""
    taken = {e.name for e in (*spec.bodies, *spec.joints)}
    for number, body in enumerate(spec.bodies):
        body.name = body.name or _free_name(f"body{number}", taken)
        for count, joint in enumerate(body.joints, 1):
            joint.name = joint.name or _free_name(f"{body.name}_{count}", taken)


def _free_name(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name
