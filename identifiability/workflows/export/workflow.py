"""Write the feasible standard parameters of a result into the robot file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from identifiability.effects import FAMILIES
from identifiability.effects.nominal import reference_values
from identifiability.effects.vocabulary import every_parameter
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.options import FilePath, checked
from identifiability.foundation.output import check_ending
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen
from identifiability.physical.mass import state_mass
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.export.as_json import write_parameters_json
from identifiability.workflows.export.code import write_code
from identifiability.workflows.export.entries import PhysicalEntry, Result, check_result
from identifiability.workflows.export.parameters import Written, write_parameters

#: What is written, and the ending of its file.
Format = Literal["mjcf", "urdf", "json", "python", "c"]
ENDINGS: dict[Format, str] = {
    "mjcf": ".xml",
    "urdf": ".urdf",
    "json": ".json",
    "python": ".py",
    "c": ".c",
}


@frozen(kw_only=True)
class Exported:
    """What was exported.

    Attributes
    ----------
    robot : Path
    sidecar : Path or None
    beside : mapping
        What the robot file cannot hold and the sidecar does: parameters by effect.
    error_ra, error_ra_file : float or None
        ε_RA on the fitted logs of all that was fitted, and of what the robot file alone holds;
        None where the torque does not vary.
    mass : str
        What is wrong with the total mass, and the remedy; empty if nothing is.
    anew : bool
        Whether it is another format than the robot's own file, and so without geometry.
    known : tuple of str
        Torque that is known beforehand, which was taken off and stands in the sidecar alone.
    mended : bool
        Whether samples of the logs were replaced: the errors are of the logs after that.
    """

    robot: Path
    sidecar: Path | None
    beside: Mapping[str, tuple[str, ...]]
    error_ra: float | None
    error_ra_file: float | None
    mass: str
    anew: bool = False
    known: tuple[str, ...] = ()
    mended: bool = False

    @property
    def statement(self) -> str:
        """What the files hold, in words."""
        parts = []
        if self.beside:
            held = [f"{effect} ({listing(n, 4)})" for effect, n in self.beside.items()]
            stand = "it stands" if len(held) == 1 else "they stand"
            parts.append(
                f"{self.robot.name} cannot hold {listing(held, len(held))}: {stand} in the "
                "sidecar, which simulators do not read."
            )
        if self.known:
            parts.append(
                f"Torque that is known beforehand ({'; '.join(self.known)}) is beside what was "
                f"fitted: it stands in the sidecar alone, and {self.robot.name} moves without it."
            )
        if self.error_ra is not None and self.error_ra_file is not None:
            parts.append(
                f"On the fitted logs the real robot errs by {100 * self.error_ra:.3g} %, and what "
                f"{self.robot.name} alone holds by {100 * self.error_ra_file:.3g} %."
            )
            if self.mended:
                parts.append("Where samples were mended, these errors are of the mended ones.")
        if self.anew:
            parts.append(
                f"{self.robot.name} is of another format than the robot's own file: it has no "
                "geometry, so nothing is seen and nothing collides."
            )
        return " ".join(parts)

    def _repr_html_(self) -> str:
        files = " and ".join(str(path) for path in (self.robot, self.sidecar) if path is not None)
        return shown("\n".join(filter(None, (f"Written: {files}", self.mass, self.statement))))


@checked
def export(
    robot: RobotLike, result: FilePath, out: FilePath, form: Format | None = None
) -> Exported:
    """Write the nearest real robot of a JSON result as a robot file, and a sidecar if it needs one.

    Parameters
    ----------
    robot : Robot, path or shipped name
        The robot that the result is about.
    result : path
        JSON of `analyze`, `prune` or `diagnose`.
    out : path
        ``.xml`` for MJCF, ``.urdf`` for URDF, from either kind of file; ``.json`` for the
        parameters alone; ``.py`` and ``.c`` for a function of position, velocity and acceleration
        that returns the torque, of a closed chain in Python (extra ``codegen``).
    form : {"mjcf", "urdf", "json", "python", "c"}, optional
        By default what the ending says.

    Raises
    ------
    IdentifiabilityError
        If the file is no result, one of another robot, or has no masses; if code was asked for
        that cannot be generated.
    """
    robot = robot if isinstance(robot, Robot) else Robot.load(robot)
    content = read_document(result, Result, "JSON", "result", IdentifiabilityError)
    if content.nothing:
        raise IdentifiabilityError(
            f"Nothing can be exported, because {content.nothing} ({result}); give a result of "
            "other logs."
        )
    physical = content.physical
    shapes = physical.shapes
    effect_of = {n: FAMILIES[p.group] for n, p in every_parameter(robot, shapes).items()}
    check_result(robot, Path(result), content, {*effect_of, *robot.nominal})
    given = physical.parameters
    loaded = any(value and n in effect_of and effect_of[n].loaded for n, value in given.items())
    reference = reference_values(robot) if loaded else {}
    wanted = _find_format(Path(out), form)
    path = None
    if wanted == "json":
        path = write_parameters_json(robot, content, Path(out))
    elif wanted in ("python", "c"):
        path = write_code(robot, given, shapes, Path(out), "c" if wanted == "c" else "python")
    if path is not None:
        return Exported(
            robot=path,
            sidecar=None,
            beside={},
            error_ra=physical.error_ra,
            error_ra_file=physical.error_ra,
            mass=state_mass(robot, given, physical.cad_prior),
            mended=content.mended,
        )
    written = write_parameters(robot, given, out, keep=False, shapes=shapes, reference=reference)
    beside: dict[str, list[str]] = {}
    for name in written.beside:
        if name not in effect_of and name[:-1] in written.beside:
            continue  # one way of a level that both have
        title = effect_of[name].title if name in effect_of else name
        beside.setdefault(title, []).append(name)
    anew = robot.mjcf != (written.robot.suffix.lower() == ".xml")
    return Exported(
        anew=anew,
        known=tuple(k.text for k in robot.known_torque),
        robot=written.robot,
        sidecar=written.sidecar,
        beside={title: tuple(names) for title, names in beside.items()},
        error_ra=physical.error_ra,
        error_ra_file=_error_of_file(written, physical) if anew else physical.error_ra_file,
        mass=state_mass(robot, given, physical.cad_prior),
        mended=content.mended,
    )


def _find_format(out: Path, form: Format | None) -> Format:
    """Return the format that is asked for; it and the ending must agree.

    Raises
    ------
    OutputError
    """
    if form is not None:
        check_ending(out, ENDINGS[form])
        return form
    check_ending(out, *ENDINGS.values())
    return next(name for name, ending in ENDINGS.items() if ending == out.suffix.lower())


def _error_of_file(written: Written, physical: PhysicalEntry) -> float | None:
    """Return the error of a file of another format alone; None where nobody measured it."""
    return None if written.beside else physical.error_ra
