"""What of a robot can collide: shapes that its file declares for that, on joints that move them.

Shapes that are only seen (`<visual>`; `contype` and `conaffinity` of zero) are none. Meshes are
taken as their convex hulls, as simulators do.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.robot.description import Description
from identifiability.robot.files import plain_urdf
from identifiability.robot.markup import check_regular, check_weight, read_markup

#: What is no body of a robot.
_GROUND = ("plane", "hfield")


def read_geometry(robot: Description) -> Any:
    """Return the shapes of a robot as a `pinocchio.GeometryModel`, with the pairs to watch.

    Bodies next to each other (by a joint, or where a loop closes) are no pair, nor are shapes that
    the file keeps from colliding.

    Parameters
    ----------
    robot : Description

    Raises
    ------
    RobotError
        If a shape cannot be read, such as a mesh that is not there.
    """
    root = read_markup(robot.path)
    try:
        shapes = list(_of_mjcf(robot, root) if robot.mjcf else _of_urdf(robot, root))
    except (ValueError, RuntimeError, SystemError, OSError) as error:
        reason = " ".join(str(error).split())[:200].rstrip(".")
        raise RobotError(f"The shapes of {robot.path} cannot be read: {reason}.") from None
    found = pin.GeometryModel()
    masks = []
    for k, (body, place, shape, mask) in enumerate(shapes):
        frame = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)]
        at = frame.placement * place
        found.addGeometryObject(pin.GeometryObject(f"{body}#{k}", frame.parentJoint, at, shape))
        masks.append(mask)
    near = _neighbours(robot)
    objects = list(found.geometryObjects)
    for a in range(len(objects)):
        for b in range(a):
            joints = frozenset((objects[a].parentJoint, objects[b].parentJoint))
            (c1, f1), (c2, f2) = masks[a], masks[b]
            if len(joints) == 2 and joints not in near and (c1 & f2 or c2 & f1):
                found.addCollisionPair(pin.CollisionPair(b, a))
    return found


def body_of(shape: Any) -> str:
    """Return the body that a shape is of."""
    return str(shape.name).rpartition("#")[0]


def _neighbours(robot: Description) -> set[frozenset[int]]:
    """Return pairs of joints whose bodies touch because they are joined."""
    model = robot.model
    near = {frozenset((k, int(model.parents[k]))) for k in range(1, model.njoints)}
    axes = np.repeat(np.arange(1, model.njoints), list(model.nvs)[1:])
    whole = [0, *(int(axes[j.iv]) for j in robot.tree.joints if j.iv < len(axes))]
    for loop in robot.loops:
        ends = [p.joint + 1 for p in (loop.first, loop.second)]
        if max(ends) < len(whole):
            near.add(frozenset(whole[e] for e in ends))
    return near


def _of_urdf(robot: Description, root: Any) -> Iterator[tuple[str, Any, Any, tuple[int, int]]]:
    """Give body, place, shape and mask of everything in `<collision>`."""
    if not any(True for _ in root.iter("collision")):
        return
    text = plain_urdf(root, robot.path.stem)
    model = pin.buildModelFromXML(text)
    folder = robot.path.resolve().parent
    packages = [str(folder), *(str(p) for p in list(folder.parents)[:3])]
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "").removeprefix("package://").removeprefix("file://")
        for place in packages:  # a pipe would be waited for, a device has no end
            check_regular(Path(place, name))
            check_weight(robot.path, [Path(place, name)])
    kind = pin.GeometryType.COLLISION
    read = pin.buildGeomFromUrdfString(model, text, kind, package_dirs=packages)
    for shape in read.geometryObjects:
        frame = model.frames[shape.parentFrame]
        solid = shape.geometry
        if hasattr(solid, "buildConvexHull"):
            solid.buildConvexHull(True, "Qt")
            solid = solid.convex
        yield frame.name, frame.placement.actInv(shape.placement), solid, (1, 1)


def _of_mjcf(robot: Description, root: Any) -> Iterator[tuple[str, Any, Any, tuple[int, int]]]:
    """Give body, place, shape and mask of every geom that collides."""
    import mujoco  # noqa: PLC0415 - large

    from identifiability.robot.mjcf import compile_shapes  # noqa: PLC0415

    made = compile_shapes(robot.path, root)
    known = {f.name for f in robot.model.frames if f.type == pin.FrameType.BODY}
    for k in range(made.ngeom):
        geom = made.geom(k)
        kind = mujoco.mjtGeom(int(geom.type[0])).name.removeprefix("mjGEOM_").lower()
        mask = int(geom.contype[0]), int(geom.conaffinity[0])
        at, place = int(geom.bodyid[0]), _pose(geom.pos, geom.quat)
        while at and made.body(at).name not in known:
            place, at = _pose(made.body_pos[at], made.body_quat[at]) * place, made.body_parentid[at]
        if kind in _GROUND or not any(mask) or not at:
            continue  # what stands on the ground beside the robot is no body of it
        yield str(made.body(at).name), place, _solid(kind, geom.size, made, k), mask


def _pose(position: Any, quaternion: Any) -> Any:
    w, x, y, z = (float(v) for v in quaternion)
    return pin.SE3(pin.Quaternion(w, x, y, z).matrix(), np.array(position, float))


def _solid(kind: str, size: Any, made: Any, k: int) -> Any:
    """Return a geom of MuJoCo as a shape of Pinocchio's collision library."""
    import coal  # noqa: PLC0415 - only where there are shapes

    a, b, c = (float(x) for x in size)
    if kind == "sphere":
        return coal.Sphere(a)
    if kind == "capsule":
        return coal.Capsule(a, 2 * b)
    if kind == "cylinder":
        return coal.Cylinder(a, 2 * b)
    if kind == "ellipsoid":
        return coal.Ellipsoid(a, b, c)
    if kind == "box":
        return coal.Box(2 * a, 2 * b, 2 * c)
    mesh = int(made.geom_dataid[k])
    start, count = int(made.mesh_vertadr[mesh]), int(made.mesh_vertnum[mesh])
    first, faces = int(made.mesh_faceadr[mesh]), int(made.mesh_facenum[mesh])
    hull = coal.BVHModelOBBRSS()
    hull.beginModel(faces, count)
    hull.addVertices(np.array(made.mesh_vert[start : start + count], float))
    hull.addTriangles(np.array(made.mesh_face[first : first + faces], np.int32))
    hull.endModel()
    hull.buildConvexHull(True, "Qt")
    return hull.convex
