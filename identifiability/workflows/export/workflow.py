"""`export`: the feasible standard parameters of a result as a robot file."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import unified_diff
from functools import partial
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np

from identifiability.bending.stretch import SETTLE
from identifiability.effects import FAMILIES
from identifiability.effects.base import apply_tilt
from identifiability.effects.nominal import reference_values
from identifiability.effects.vocabulary import (
    Kind,
    by_effect,
    complete_values,
    convert_asymmetry,
    every_parameter,
    file_kinds,
    merge_springs,
    read_back,
    stated_numbers,
    values_in_file,
    values_not_in_file,
)
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.prediction import predict as predict_torque
from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import IdentifiabilityError, RobotError, listing, near_match
from identifiability.foundation.findings import of_key, phrase
from identifiability.foundation.linalg import NEARLY, ROUNDOFF
from identifiability.foundation.names import (
    GROUPED_KINDS,
    INERTIAL_KINDS,
    Array,
    ArrayByName,
    NumberByName,
    Strings,
)
from identifiability.foundation.options import Expected, ExportFormat, FilePath, checked
from identifiability.foundation.output import check_ending, temporary_folder, write_json, write_text
from identifiability.foundation.presenter import presented
from identifiability.foundation.quoting import for_patch, for_python, for_terminal
from identifiability.foundation.result import Result
from identifiability.foundation.runs import Run
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Dataset
from identifiability.physical.cad_prior import find_larger, find_rises, state_mass
from identifiability.physical.pseudo_inertia import check_body
from identifiability.quality.recordings import Logs, list_logs
from identifiability.reading import CarriedReading
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.elastic import Spring
from identifiability.robot.locate import SMALLEST
from identifiability.robot.servo import Servo, state_delay
from identifiability.robot.table import write_converted
from identifiability.robot.write import write_robot
from identifiability.simulation import MujocoRobot, PrescribedMotion
from identifiability.simulation.elastic import bend
from identifiability.simulation.rollout import moves_by_commands
from identifiability.workflows.case import Case, Use
from identifiability.workflows.predict import (
    BendingEntry,
    FitEntry,
    PeakEntry,
    PositionPrediction,
    ResultEntry,
    check_reading,
    note_change,
    predict,
    read_fit,
    read_real,
    refuse_robot,
    state_missing,
)

from .joints import describe_joints, state_doubted
from .snippet import write_snippet


def check_result(robot: Robot, path: Path, content: ResultEntry, known: set[str]) -> None:
    """Refuse a result of another robot, or of a part of one, and impossible bodies.

    Raises
    ------
    IdentifiabilityError
    """
    given = content.physical.parameters
    unknown = next((name for name in given if name not in known), None)
    if unknown is not None:
        why = phrase("result.other", "unknown", name=unknown)
        raise refuse_robot(path, content, robot, why)
    masses = {body: robot.nominal[f"{body}.m"] for body in robot.bodies}
    # A body with less than this share of the robot's mass has no mass: formats need a number.
    heavy = [b for b, mass in masses.items() if mass > ROUNDOFF * sum(masses.values())]
    missing = [b for b in heavy if not abs(given.get(f"{b}.m", 0.0)) > SMALLEST]
    if missing:
        held = robot.base is not None and len(missing) < len(heavy)
        why = "stand" if held else "massless"
        raise IdentifiabilityError(phrase("exported", why, path=path, bodies=missing))
    whole = complete_values(robot, given, keep=False)
    for body in robot.bodies:
        numbers = np.array([whole[f"{body}.{kind}"] for kind in GROUPED_KINDS])
        wrong = check_body(numbers, body)
        if wrong:
            raise IdentifiabilityError(f"{path}: {wrong}")


# Write a robot file with other parameters, in the robot's own format or in the other one.


@frozen
class Written:
    """Written files.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    beside : tuple of str
        Parameters that the sidecar holds because the robot file cannot.
    """

    robot: Path
    sidecar: Path | None = None
    beside: Strings = ()


def save_robot(robot: Robot, values: NumberByName, path: str | Path) -> Path:
    """Write a robot with other standard parameters; see `Robot.save`.

    Raises
    ------
    RobotError
        If the robot has no such parameter.
    """
    known = every_parameter(robot)
    for name in values:
        if name not in known and name not in robot.nominal:
            raise RobotError(
                f"{robot.name} has no parameter '{name}'{near_match(name, [*robot.nominal])} Give "
                "keys of robot.nominal, or parameters of effects."
            )
    return write_parameters(robot, values, path).robot


def write_parameters(
    robot: Robot,
    parameters: NumberByName,
    path: str | Path,
    *,
    keep: bool = True,
    shapes: NumberByName | None = None,
    reference: NumberByName | None = None,
    comment: str = "",
) -> Written:
    """Write a robot file with other parameters; a sidecar holds the values that it cannot.

    Parameters
    ----------
    robot : Robot
        Whose file is the template.
    parameters : mapping
        Standard parameters by name (``platform.mx``, ``slider1.Fv`` …).
    path : str or Path
        ``.xml`` for MJCF, ``.urdf`` for URDF. In the template's format everything but the numbers
        stays; the other one is written anew, without geometry.
    keep : bool
        Whether parameters that are not given keep the file's values; else joints have none.
    shapes : mapping, optional
        Shapes of effects by ``<joint>.<effect>``; by default those that the robot has.
    reference : mapping, optional
        Standard parameters that determine loads; by default those that the robot has.

    Raises
    ------
    RobotError
        If the format cannot hold the robot or a body has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    path = Path(path)
    robot, parameters = apply_tilt(robot, parameters)
    shapes = robot.shapes if shapes is None else shapes
    reference = robot.reference if reference is None else reference
    whole = complete_values(robot, parameters, keep=keep)
    ending = path.suffix.lower()
    if ending in (".xml", ".urdf") and (ending == ".urdf") == robot.mjcf:
        more: Any = {"shapes": shapes, "reference": reference, "comment": comment}
        with temporary_folder() as folder:
            template = _convert(robot, Path(folder) / f"{path.stem}{ending}")
            return write_parameters(template, whole, path, keep=False, **more)
    robot, values = merge_springs(robot, convert_asymmetry(robot, whole))
    tables = {"shapes": shapes, "reference": reference}
    return _write_native(robot, values, path, tables, comment)


def _write_native(
    robot: Robot,
    values: dict[str, float],
    path: Path,
    tables: dict[str, NumberByName],
    comment: str,
) -> Written:
    """Write a robot file in the format of the robot's own, and its sidecar.

    Parameters
    ----------
    robot : Robot
    values : mapping
        All standard parameters.
    path : Path
    tables : mapping
        Of the sidecar, without the values that the file does not have.
    comment : str
    """
    alone = read_back(robot, values)
    nominal = _values_beside(robot, values, alone)
    rest = {} if robot.mjcf else _rests(robot, values)
    tables = {"nominal": nominal, **tables, "rest": rest}
    bodies = {b: np.array([values[f"{b}.{kind}"] for kind in INERTIAL_KINDS]) for b in robot.bodies}
    stated = stated_numbers(robot, values)
    sidecar = write_robot(robot, path, bodies, stated, tables, comment)
    # The file has the sum of rotors, and of dry friction with levels that it reaches.
    parts = robot.inertia_parts if robot.mjcf else ()
    summed = {n for n in nominal if n.rpartition(".")[2] in parts or alone.get(n)}
    lost = tuple(name for name in nominal if name not in summed)
    return Written(path, sidecar, lost)


def _convert(robot: Robot, path: Path) -> Robot:
    """Return the same robot in the other format, as a template file."""
    write_converted(robot, path)
    how: Any = {"rest": robot.rest, "servo": robot.servo, "springs": robot.springs}
    converted = replace(Robot.load(path), **how)
    return converted.turned(robot.gravity)


def _values_beside(robot: Robot, values: NumberByName, alone: NumberByName) -> dict[str, float]:
    """Return the values that the robot file alone, with its own values, does not have."""
    beside = {n: v for n, v in values.items() if v != alone.get(n, 0.0)}
    servo = robot.known_servo
    if robot.mjcf and servo is not None:
        # The file has rotors for its own step, and less damping where positions are delayed.
        exact = {f"{joint}.{part}" for joint in robot.joints for part in robot.inertia_parts}
        late = servo.damping < 0
        exact |= {f"{joint}.Fv" for joint, x in zip(robot.joints, late, strict=True) if x}
        beside |= {n: v for n, v in values.items() if n in exact}
    return beside


def _rests(robot: Robot, values: NumberByName) -> dict[str, float]:
    """Return where the springs of joints are relaxed; those of stated axes stand with them."""
    joints = robot.tree.single
    return {j: x for j, x in robot.rest.items() if j in joints and values.get(f"{j}.K")}


# Write the feasible standard parameters of a result into the robot file.


#: Kinds of written files, and their endings.
Format = ExportFormat
ENDINGS: dict[Format, str] = {
    "mjcf": ".xml",
    "urdf": ".urdf",
    "isaaclab": ".py",
    "patch": ".patch",
}


@frozen(kw_only=True)
class Exported:
    """Result of an export.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    beside : mapping
        Values that the file cannot hold: parameters by effect. A sidecar has them.
    error_ra, error_ra_file : float or None
        ε_RA on the fitted logs, with all fitted values and with those that the robot file alone
        holds; None where the torque does not vary. The second is None, too, where the error of the
        file cannot be told from the fault of a sensor.
    unseen : Unseen, PositionPrediction or None
        Errors of the files on logs that were not fitted, where some were given; of logs of commands
        those of positions.
    mass : str
        A warning on the total mass, and the remedy; empty if the mass is plausible.
    notes : tuple of str
        Further remarks for the user.
    snippet : Path or None
        Torque that the file cannot hold, as a function for MuJoCo.
    added : tuple of str
        Effects that are in it.
    lacking : str
        The effects that the file cannot hold, their largest torque, and the remedy.
    joints : tuple of str
        A line for each joint: armature, damping and friction, and which of them the logs determine.
    """

    robot: Path
    sidecar: Path | None
    beside: Mapping[str, Strings]
    error_ra: float | None
    error_ra_file: float | None
    mass: str
    unseen: Unseen | PositionPrediction | None = None
    notes: Strings = ()
    snippet: Path | None = None
    added: Strings = ()
    joints: Strings = ()
    lacking: str = ""

    @property
    @presented
    def statement(self) -> str:
        """Description of the files."""
        raise NotImplementedError


@checked
def export(
    robot: RobotLike,
    result: Annotated[
        str | Path | Result,
        Expected("a result of analyze, prune or diagnose, or the path of its JSON"),
    ],
    out: FilePath,
    form: Format | None = None,
    *,
    validate: Logs = (),
    force: bool = False,
) -> Exported:
    """Write the nearest physical robot of a JSON result as a robot file, with a sidecar if needed.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : result, or path
        Result of `analyze`, `prune` or `diagnose`, or its JSON.
    out : path
        ``.xml`` for MJCF, ``.urdf`` for URDF, from either kind of file; ``.py`` for a configuration
        of actuators (isaaclab); ``.patch`` for the changes of the robot's file and sidecar, as a
        unified diff.
    form : {"mjcf", "urdf", "isaaclab", "patch"}, optional
        What to write; by default that of the ending. From an MJCF comes a URDF as well, and the
        other way round, without geometry; isaaclab is a configuration of actuators for robots with
        servos.
    validate : log, path, DataFrame, or several
        Logs that were not fitted. The written file is compared with the robot's file on them.
    force : bool
        Whether to write a robot file with larger errors than the robot's file. Errors count on
        these logs, on the fitted and on the held-out logs of the result.

    Raises
    ------
    IdentifiabilityError
        If the file is no result, one of another robot, or has no masses; if a robot file errs more
        than the one that it comes from.
    """
    if isinstance(result, Result):
        with temporary_folder() as folder:
            path = write_json(Path(folder) / "result.json", result.to_dict())
            return export(robot, path, out, form, validate=validate, force=force)
    own = Robot.of(robot)
    out = Path(out)
    wanted = _find_format(out, form)
    if wanted == "patch":
        return _write_patch(own, result, out, validate=validate, force=force)
    content, robot, given = read_real(result, own, "exported")
    known = every_parameter(robot, content.physical.shapes)
    check_result(robot, Path(result), content, {*known, *robot.nominal})
    given |= _as_stated(robot, given)
    said = note_change(result, content.robot, own)
    if wanted == "isaaclab":
        written = Written(write_isaaclab(robot, given, content, out))
        found = _describe(robot, content, given, written, wanted)
        return replace(found, notes=(*said, *found.notes))
    bent = wanted == "mjcf" and bool(content.bending.parameters)
    if bent:
        robot, given = with_springs(robot, content.bending)
    # Errors of the result are those of rigid joints.
    rises = () if bent else _state_rises(own, content, wanted, out.name)
    lacking = _state_lacking(robot, content, given, wanted, out.name)
    in_any = lacking and values_not_in_file(robot, given, "mjcf")
    lost = " ".join([lacking, phrase("exported", "lost_in_any")] if in_any else [lacking])
    if rises and not force:
        why = " ".join(filter(None, (*rises, lost)))
        raise IdentifiabilityError(phrase("exported", "errs_more", rises=why))
    write = _prepare_writing(robot, content, given, lacking)
    unseen = None
    if list_logs(validate):
        with temporary_folder() as folder:
            unseen = judge_files(own, write(Path(folder) / out.name), validate, content)
        if content.rollout is None and content.fit is not None:
            said += check_reading(read_fit(result, own), validate)
        if unseen.totals[1] > unseen.totals[0] and not force:
            errors = phrase("exported", "worse", told=unseen.told, file=out.name)
            reasons: list[str] = [*of_key(said, "reading_contradicted"), errors, lost]
            raise IdentifiabilityError(" ".join(filter(None, reasons)))
    found = _describe(robot, content, given, write(out), wanted, unseen)
    found = replace(found, notes=(*said, *rises, *found.notes))
    if bent:
        found = replace(found, error_ra=None, error_ra_file=None)
    if found.sidecar is None:
        return found
    return _add_snippet(own, found)


def with_springs(robot: Robot, found: BendingEntry) -> tuple[Robot, dict[str, float]]:
    """Return a robot with the springs of joints that bend, and its parameters.

    Raises
    ------
    IdentifiabilityError
        If the robot has no such joint.
    """
    springs = dict(robot.springs)
    for x in found.joints:
        if x.joint not in robot.joints:
            raise IdentifiabilityError(phrase("exported", "springless", joint=x.joint))
        known = springs.get(x.joint, Spring(0.0, 0.0))
        springs[x.joint] = replace(known, stiffness=x.stiffness, damping=x.damping)
    robot = replace(robot, springs=springs)
    return apply_tilt(robot, found.parameters)


def _state_rises(robot: Robot, content: ResultEntry, kind: Kind, name: str) -> Strings:
    """Return a sentence for each motion on which a file has larger errors than the robot's file.

    Of logs of commands these are errors of positions, else of torque. Files of one format are
    compared. Rises without evidence are left out.

    Parameters
    ----------
    robot : Robot
    content : ResultEntry
    kind : {"mjcf", "urdf"}
        Format that is written.
    name : str
        Of the file that is written.
    """
    moved = content.rollout
    if moved is None:
        rises = find_rises(vars(content.physical), kind)
    else:
        rises = find_larger({"moved": (moved.error, moved.error_file)})
    said = []
    for rows, (new, before) in rises.items():
        both = {"file": name, "new": new, "own": robot.path.name, "before": before}
        said.append(phrase("errs_more", rows, **both))
    return tuple(said)


def _state_lacking(
    robot: Robot, content: ResultEntry, given: NumberByName, kind: Kind, name: str
) -> str:
    """Return the effects that a file cannot hold, their largest torque, and the remedy.

    Parameters
    ----------
    robot, content
    given : mapping
        Standard parameters that are to be written.
    kind : {"mjcf", "urdf", "isaaclab"}
    name : str
        Of the file.
    """
    lacking = _list_lacking(robot, content, given, kind)
    return state_lost(robot, given, lacking, kind, name, content.physical.lost.get(kind))


def state_lost(
    robot: Robot,
    values: NumberByName,
    lacking: Mapping[str, Strings],
    kind: Kind,
    name: str,
    most: PeakEntry | None = None,
) -> str:
    """Return the effects that a file cannot hold, and the remedy; empty without any.

    Faults of sensors are none of the robot: they are said apart.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Standard parameters that are to be written.
    lacking : mapping
        Parameters that the file cannot hold, by effect.
    kind : {"mjcf", "urdf", "isaaclab"}
    name : str
        Of the file.
    most : PeakEntry, optional
        Their largest torque.
    """
    lost = values_not_in_file(robot, values, kind)
    effects, faults = list[str](), list[str]()
    for effect, names in lacking.items():
        of_robot = not lost.keys().isdisjoint(names)
        few = listing(names, 4, things="parameters")
        (effects if of_robot else faults).append(f"{effect} ({few})")
    apart = phrase("exported", "misread", file=name, effects=faults) if faults else ""
    if not effects:
        return apart
    peak = ""
    if most:
        unit = robot.torque_units[robot.joints.index(most.joint)]
        peak = phrase("exported", "peak", **vars(most), unit=unit, effects=effects)
    where = "in_function" if kind == "isaaclab" else "in_sidecar"
    said = phrase("exported", where, file=name, effects=effects, peak=peak)
    only_urdf = kind == "urdf" and not values_not_in_file(robot, lost, "mjcf")
    more = phrase("exported", "in_mjcf", effects=effects) if only_urdf else ""
    return " ".join(filter(None, (apart, said, more)))


def _list_lacking(
    robot: Robot, content: ResultEntry, given: NumberByName, kind: Kind
) -> dict[str, Strings]:
    """Return the parameters that a file cannot hold, by effect, the largest torque first.

    Faults of sensors are among them.
    """
    held = values_in_file(robot, given, kind)
    lacking = [name for name, value in given.items() if value != held[name]]
    shares = {row["name"]: row.get("torque_share") or 0.0 for row in content.parameters}
    lacking.sort(key=lambda name: -shares.get(name, 0.0))
    return by_effect(robot, lacking, content.physical.shapes)


def _has_servos(robot: Robot, content: ResultEntry) -> bool:
    """Return whether the values of a result belong to torque that its servos make of commands."""
    is_late = content.fit is not None and content.fit.delay is not None
    return content.rollout is not None or (is_late and not moves_by_commands(robot))


def _prepare_writing(
    robot: Robot, content: ResultEntry, given: NumberByName, lacking: str
) -> Callable[[Path], Written]:
    """Return the function that writes a robot file with the values of a result."""
    shapes = content.physical.shapes
    groups = {p.name: p.group for p in every_parameter(robot, shapes).values()}
    loaded = any(x and n in groups and FAMILIES[groups[n]].loaded for n, x in given.items())
    # Values from measured torque do not depend on servos of the file, which are kept.
    moved = robot if _has_servos(robot, content) else replace(robot, servo=None)
    reference = reference_values(robot) if loaded else {}
    head = [state_servos(robot, content), lacking]
    lines = _describe_joints(robot, content, given)
    if lines:
        head.append(phrase("exported", "joints"))
        head.append(phrase("exported", "rotors") if moved.servo else "")
        head += lines
    head.append(state_doubted(content.parameters))
    comment = "\n       ".join(filter(None, head))
    how: Any = {"shapes": shapes, "reference": reference, "comment": comment}
    return partial(write_parameters, moved, given, keep=False, **how)


def _describe(
    robot: Robot,
    content: ResultEntry,
    given: NumberByName,
    written: Written,
    kind: Kind,
    unseen: Unseen | PositionPrediction | None = None,
) -> Exported:
    """Return the export without a function for MuJoCo.

    Parameters
    ----------
    robot, content
    given : mapping
        Standard parameters that were written.
    written : Written
    kind : {"mjcf", "urdf", "isaaclab"}
    unseen : Unseen or PositionPrediction, optional
    """
    physical = content.physical
    lacking = _list_lacking(robot, content, given, kind)
    error_file = physical.error_ra_files.get(kind)
    lost = values_not_in_file(robot, given, kind)
    if any(lost.keys().isdisjoint(names) for names in lacking.values()):
        # A sensor's fault is no error of the file.
        error_file = None if lost else physical.error_ra
    mass = state_mass(robot, given, physical.cad_prior)
    notes = _state_notes(robot, content, kind, written.robot.name, said=unseen is not None)
    return Exported(
        robot=written.robot,
        sidecar=written.sidecar,
        beside=lacking,
        error_ra=physical.error_ra,
        error_ra_file=error_file,
        unseen=unseen,
        mass=mass,
        notes=tuple(notes),
        joints=_describe_joints(robot, content, given),
        lacking=_state_lacking(robot, content, given, kind, written.robot.name),
    )


def _describe_joints(robot: Robot, content: ResultEntry, given: NumberByName) -> Strings:
    """Return a line for each joint of a result: its numbers with their reliability."""
    gains = content.fit.servo if content.fit else {}
    weight = content.physical.cad_prior if content.rollout is not None else 0.0
    share = (2 * weight) ** -0.5 if weight else None  # as `analyze` makes the weight
    return describe_joints(robot, content.parameters, given, gains, share)


def _add_snippet(robot: Robot, found: Exported) -> Exported:
    """Return the export, with a function for MuJoCo where its file lacks torque."""
    assert found.sidecar is not None
    read = partial(_reread, robot, found.robot, found.sidecar)
    # The name differs from that of the other format's file.
    stem = found.sidecar.stem.replace(".", "_")
    place = found.robot.with_name(f"{stem}_torque.py")
    snippet, added = write_snippet(read(alone=False), read(alone=True), place)
    unseen = found.unseen
    if isinstance(unseen, Unseen) and snippet is not None and {*found.beside} == {*added}:
        unseen = replace(unseen, callback=snippet.name)
    return replace(found, snippet=snippet, added=tuple(added), unseen=unseen)


def _write_patch(robot: Robot, result: Path | str, path: Path, **how: Any) -> Exported:
    """Write the changes of an export to a robot's file and sidecar; ``patch -p1`` applies them."""
    with temporary_folder() as folder:
        made = export(robot, result, Path(folder) / robot.path.name, **how)
        pairs = ((robot.path, made.robot), (robot.sidecar, made.sidecar))
        text = "".join(_difference(own, new) for own, new in pairs if new is not None)
    return replace(made, robot=write_text(path, text), sidecar=None, snippet=None)


def _difference(own: Path | None, new: Path) -> str:
    """Return a unified diff of two files, of which the first may be missing."""
    before = "/dev/null" if own is None else for_patch(f"a/{own.name}")
    after = for_patch(f"b/{(own or new).name}")
    old = [] if own is None else _read_lines(own)
    ended = "{}\n\\ No newline at end of file\n"
    lines = unified_diff(old, _read_lines(new), before, after)
    return "".join(line if line.endswith("\n") else ended.format(line) for line in lines)


def _read_lines(path: Path) -> list[str]:
    """Return the lines of a file as a patch counts them: a line feed alone ends one."""
    with path.open(encoding="utf-8", newline="\n") as file:
        return file.readlines()


def _as_stated(robot: Robot, given: NumberByName) -> dict[str, float]:
    """Return, as the file states them, the bodies that differ from the file's by rounding only."""
    out: dict[str, float] = {}
    for body in robot.bodies:
        names = [f"{body}.{kind}" for kind in INERTIAL_KINDS]
        own = {n: robot.nominal[n] for n in names}
        apart = [abs(given.get(n, np.inf) - x) for n, x in own.items()]
        if max(apart) <= NEARLY * max(map(abs, own.values())):
            out |= own
    return out


def _state_notes(
    robot: Robot, content: ResultEntry, kind: Kind, name: str, *, said: bool
) -> Iterator[str]:
    """Yield the notes on a file that was written, with its error unless that is stated."""
    moved = content.rollout
    if moved is not None and not said:
        yield moved.statement
    if moved is not None and moved.slide:
        part = "bristles" if kind == "mjcf" else "coulomb"
        most = 1e3 * max(moved.slide.values())
        yield phrase("exported", part, file=name, joints=[*moved.slide], most=most)
    if moved is not None:
        yield from _note_scales(robot, content, name)
    if moved is None and robot.servo is not None:
        which = "late" if robot.servo.delay else "delay"
        yield phrase("exported", which, late=1e3 * (robot.servo.delay or 0.0))
    if robot.tilt is not None:
        yield phrase("exported", "tilt", file=name, tilt=robot.tilt.text)
    if kind != "isaaclab" and robot.known_torque:
        known = "; ".join(k.text for k in robot.known_torque)
        yield phrase("exported", "known", file=name, known=known)
    if kind != "isaaclab" and content.bending.joints:
        yield _note_springs(content.bending, kind, name)
    if kind not in ("isaaclab", file_kinds(robot)[0]):
        yield phrase("exported", "format", file=name)
    if content.warnings:
        yield phrase("exported", "warned", warnings=content.warnings)
    yield from state_missing(content.missing)


def _note_scales(robot: Robot, content: ResultEntry, name: str) -> Iterator[str]:
    """Yield the note on gains that hold a scale of the torque, if some do."""
    scales = [(j, content.physical.parameters.get(f"{j}.scale")) for j in robot.joints]
    weak = [f"{joint} {1.0 + x:.3g}" for joint, x in scales if x]
    if weak:
        yield phrase("exported", "weak", file=name, weak=weak)


def _note_springs(found: BendingEntry, kind: Kind, name: str) -> str:
    """Return the note on joints that bend."""
    joints = [x.joint for x in found.joints]
    if kind == "urdf":
        return phrase("exported", "urdf_springs", file=name, joints=joints)
    if found.rigid:
        return phrase("exported", "stiff", file=name, joints=joints, why=found.rigid)
    return phrase("exported", "springs", file=name, joints=joints)


# How much files err on logs that were not fitted, as this package reads them.


#: Tables of a sidecar that no simulator reads: without them a robot has the content of its file
#: alone.
_BESIDE = ("nominal", "shapes", "reference", "rest", "known_torque")


@frozen
class Unseen:
    """Errors of robot files on logs that were not fitted.

    Attributes
    ----------
    logs : tuple of str
    names : (str, str)
        Of the robot's own file, and of the one that was written.
    before, written, both : float
        ε_RA of the robot's own file, of the written one, and of that with its sidecar.
    worst : str
        Joint at which the written file alone errs most over its own variation.
    callback : str
        Another holder of the sidecar's values: the function for MuJoCo.
    """

    logs: Strings
    names: tuple[str, str]
    before: float
    written: float
    both: float
    worst: str
    callback: str = ""

    @property
    def totals(self) -> tuple[float, float]:
        """Of the robot's own file, and of the written one."""
        return self.before, self.written

    @property
    @presented
    def told(self) -> str:
        """The errors, in a sentence."""
        raise NotImplementedError


def judge_files(
    robot: Robot, written: Written, logs: Logs, content: ResultEntry
) -> Unseen | PositionPrediction:
    """Return the errors of a robot's file and of another one, both read like any file.

    Parameters
    ----------
    robot : Robot
    written : Written
    logs : log, path, DataFrame, or several
        With torque. If the fitted logs had commands, these need commands, too; they move the robots
        of the files alone.
    content : ResultEntry
        States the kind of logs and their preparation.
    """
    read = partial(_reread, robot, written.robot, written.sidecar)
    if content.rollout is not None:
        return cast("PositionPrediction", predict(robot, read(alone=False), logs, forward=True))
    files = [_reread(robot, robot.path, robot.sidecar, alone=True), read(alone=True)]
    if written.sidecar:
        files += [read(alone=False)]
    judged = [_predict_by_file(copy, logs, content.fit) for copy in files]
    errors = [float(found.relative_error()[0]) for found, _ in judged]
    found, names = judged[1]
    worst = robot.joints[int(np.argmax(found.joint_error()[:, 0]))]
    both = robot.path.name, written.robot.name
    return Unseen(names, both, errors[0], errors[1], errors[-1], worst)


def _predict_by_file(
    robot: Robot, logs: Logs, entry: FitEntry | None
) -> tuple[Prediction, Strings]:
    """Return torque along logs by all values of a robot file, and the names of the logs.

    Logs are read as those of the result, without gravity where their torque lacks it. Their
    commands have its delay.
    """
    how = None if entry is None else entry.preparation
    reading = None if entry is None else entry.reading
    if robot.servo is not None and entry is not None and entry.delay is not None:
        robot = replace(robot, servo=replace(robot.servo, delay=entry.delay))
    stated = {name for name, value in robot.nominal.items() if value}
    # One level of dry friction stands for both directions, too.
    effects = [f.effect for name, f in FAMILIES.items() if name != "coulomb_friction"]
    model = Model(tuple(e for e in effects if stated & {p.name for p in e.parameters(robot)}))
    carried = CarriedReading.of_entry(reading, robot)
    case = Case(
        robot,
        logs,
        preparation=how,
        reading=carried,
        use=Use(divides=False, commands=not moves_by_commands(robot)),
    )
    structure = Structure.of(robot if carried is None else carried.turn(robot), model)
    samples = case.samples(structure.robot, Run(), "compared")
    if robot.springs:
        samples = tuple(_take_springs_off(robot, log) for log in samples)
    regression = Regression(structure.robot, model, samples)
    found = predict_torque(regression, structure.nominal[:, None])
    return found, tuple(s.name for s in samples)


def _take_springs_off(robot: Robot, log: Dataset) -> Dataset:
    """Return a log without the torque that the springs of a robot file add to rigid joints.

    The first deflection is not measured: samples that depend on it have no weight.
    """
    motion = log.motion
    move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
    bent, _ = bend(robot, move)
    rigid = MujocoRobot(robot).inverse_dynamics(move.q, move.dq, move.ddq)
    settled = motion.t - motion.t[0] >= SETTLE
    weight = log.weight * settled[:, None]
    tau = log.tau - bent + rigid.tau
    return replace(log, tau=tau, weight=weight)


def _reread(robot: Robot, path: Path, sidecar: Path | None, *, alone: bool) -> Robot:
    """Return the robot of a written file; `alone` leaves out torque that only its sidecar holds."""
    with temporary_folder() as folder:
        given = {} if sidecar is None else tomllib.loads(sidecar.read_text("utf-8-sig"))
        kept = {key: x for key, x in given.items() if not alone or key not in _BESIDE}
        beside = Path(folder) / "sidecar.toml"
        write_text(beside, toml_text(kept))
        # A written file states locked joints itself, or merges their bodies.
        lock = {name: robot.locked[name] for name in robot.lock_option if path == robot.path}
        base: Any = robot.base_option
        copy = Robot.load(path, beside, lock=lock, base=base)
    told = {key: getattr(robot, key) for key in ("columns", "time_unit", "angles", "torque")}
    return replace(copy, **told, sidecar=None)


# Numbers of servos that a simulator needs, other than gains.


def state_servos(robot: Robot, content: ResultEntry) -> str:
    """Return a sentence on the servos of an exported robot file; empty where it has none."""
    servo = robot.servo
    moved = content.rollout
    if servo is None or moved is None:
        return ""
    delay = state_delay(np.array(moved.delays))[1:]
    told = {"moved": moved.statement, "delay": delay, "names": moved.logs}
    return phrase("exported", "servos", **told, rate=servo.rate)


ACTUATORS = '''"""Fitted servos of a robot: a configuration for Isaac Lab.

These numbers hold with the fitted bodies: import the file that
`identifiability export ROBOT RESULT --out fitted.xml` (or .urdf) writes. They hold at any
physics step. Friction is torque [N·m], as Isaac Sim 5 and later take it. What the logs do
not determine by itself is near the robot file's.
"""

from isaaclab.actuators import DelayedPDActuatorCfg

{joint_lines}ROBOT = {title}
PHYSICS_DT = 0.001  # [s], that of your simulation: delays are whole steps of it
DELAY = {delay:.6g}  # [s], from a command's row until it acts

SERVOS = DelayedPDActuatorCfg(
    joint_names_expr={joints},
{rows}
    min_delay=round(DELAY / PHYSICS_DT),
    max_delay=round(DELAY / PHYSICS_DT),
)
'''


def write_isaaclab(robot: Robot, given: NumberByName, content: ResultEntry, out: Path) -> Path:
    """Write the servos as a configuration of actuators for Isaac Lab.

    Raises
    ------
    RobotError
        If the robot has no servos.
    """
    servo = robot.servo
    if servo is None or servo.unknown.any():
        raise RobotError(phrase("exported", "gainless", path=robot.path))
    delay = servo.delay if content.rollout is None else content.rollout.delay
    columns = {"stiffness": servo.kp, "damping": servo.kv, "effort_limit": _limit_effort(servo)}
    numbers = {
        "armature": "armature",
        "friction": "frictionloss",
        "viscous_friction": "damping",
        "dynamic_friction": "frictionloss",
    }
    stated = stated_numbers(robot, complete_values(robot, given, keep=False), "isaaclab")
    for word, number in numbers.items():
        columns[word] = np.array([stated[joint][number] for joint in robot.joints])
    names = [re.escape(joint) for joint in robot.joints]  # Isaac Lab reads them as patterns
    title = for_python(robot.title or robot.name)
    lacking = _state_lacking(robot, content, given, "isaaclab", out.name)
    late = max(delay or 0.0, 0.0)
    rows = "\n".join(_actuator_rows(names, columns))
    text = ACTUATORS.format(
        title=title,
        delay=late,
        joints=for_python(names),
        joint_lines=_comment_joints(_describe_joints(robot, content, given), lacking),
        rows=rows,
    )
    return write_text(out, text)


def _limit_effort(servo: Servo) -> Array:
    """Return the limits of torque for Isaac Lab; NaN where no joint has any [N·m or N]."""
    limits = np.minimum(-servo.low, servo.high)
    # In a table that names some joints only, Isaac Lab takes zero for the others; 1e9 is its
    # own number for no limit.
    unlimited = 1e9
    known = np.minimum(limits, unlimited)
    return known if np.isfinite(limits).any() else np.full_like(limits, np.nan)


def _comment_joints(lines: Sequence[str], lacking: str) -> str:
    """Return the lines of joints with a heading, and the effects that are lacking, as a comment."""
    head = [phrase("exported", "joints"), *lines] if lines else []
    head += list(filter(None, [for_terminal(lacking)]))
    return "".join(f"# {line}\n" for line in head)


def _actuator_rows(names: Sequence[str], columns: ArrayByName) -> Iterator[str]:
    """Yield the lines of numbers of a configuration; unknown numbers are left out."""
    for word, values in columns.items():
        pairs = zip(names, values.tolist(), strict=True)
        known = {name: float(f"{x:.6g}") for name, x in pairs if not np.isnan(x)}
        if known:
            yield f"    {word}={for_python(known)},"


def _find_format(out: Path, form: Format | None) -> Format:
    """Return the format that is asked for; it and the ending must agree.

    Raises
    ------
    OutputError
    """
    endings = [ENDINGS[form]] if form else ENDINGS.values()
    check_ending(out, *endings)
    ending = out.suffix.lower()
    return next(name for name, end in ENDINGS.items() if end == ending)
