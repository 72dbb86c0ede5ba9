"""The one list of effects: the library's, and those that users register."""

import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import cloudpickle

from identifiability.foundation.errors import ModelError, listing, near_match
from identifiability.foundation.names import BASE, Parameter, Strings, find_named, split_pair
from identifiability.robot import Robot

from .effect import Effect, Family, Law, joint_places

#: Modules that workers have, or that are sent to them with the definitions in them.
_WITH_WORKERS = ("identifiability", "__main__")

E = TypeVar("E", bound=Effect)

#: All families by name, in the order in which they are searched and reported.
FAMILIES: dict[str, Family] = {}


def register(family: Family) -> Family:
    """Add an effect, so that models, ladders, diagnoses, exports and reports know it.

    `declare` does so for a class.

    Raises
    ------
    ModelError
        If the name is taken.
    """
    if family.name in FAMILIES:
        raise ModelError(f"There is an effect '{family.name}' already; choose another name.")
    known = {**FAMILIES, family.name: family}
    FAMILIES.clear()
    FAMILIES.update(sorted(known.items(), key=lambda item: item[1].rank))
    module = sys.modules.get(type(family.effect).__module__)
    if module is not None and module.__name__.partition(".")[0] not in _WITH_WORKERS:
        cloudpickle.register_pickle_by_value(module)  # workers do not have the user's file
    return family


def declare(
    title: str, places: Callable[[Robot], Strings] = joint_places, **facts: Any
) -> Callable[[type[E]], type[E]]:
    """Register the family of an effect's class; `facts` are further fields of `Family`.

    Example
    -------
    A study that suspects drag with the third power of speed::

        @declare("cubic drag", law=lambda speed, position, load: speed**3)
        class CubicDrag(AlongAxes):
            name, equation = "cubic_drag", "τ = Fd q̇³"
            units = (("Fd", "N·m·s³/rad³", "N·s³/m³"),)
            nonnegative = True

            def curves(self, at):
                return [at.speed**3]
    """

    def decorate(effect: type[E]) -> type[E]:
        register(Family(effect(), title, places, **facts))
        return effect

    return decorate


#: What a joint has that bends: it moves its link, and adds no torque of its own.
COMPLIANCE = "joint_compliance"


def forget(name: str) -> None:
    """Take a registered effect away again."""
    FAMILIES.pop(name, None)


def find_effect(name: str) -> Effect:
    """Return the effect of a public name.

    Raises
    ------
    ModelError
        If there is none, with the near match.
    """
    return find_family(name).effect


def find_family(name: str) -> Family:
    """Return the family of a public name.

    Raises
    ------
    ModelError
        If there is none, with the near match.
    """
    try:
        return FAMILIES[name]
    except KeyError:
        if name == COMPLIANCE:
            raise ModelError(
                f"No linear model can hold '{name}', the springs between motors and links: measure "
                "them by diagnose --bending, and write them into an MJCF by export."
            ) from None
        raise ModelError(
            f"There is no effect '{name}'{near_match(name, FAMILIES)} "
            f"The effects are {listing(FAMILIES, 30, things='effects')}."
        ) from None


def find_families(names: Iterable[str] | None, *, commanded: bool = False) -> tuple[Family, ...]:
    """Return families by name, all for None: of logs of commands, or of torque.

    Raises
    ------
    ModelError
        If there is none of a name, with the near match.
    """
    if names is None:
        other = "torque" if commanded else "commands"
        return tuple(f for f in FAMILIES.values() if f.logs != other)
    return tuple(find_family(name) for name in names)


def is_loaded(parameters: Iterable[Parameter]) -> bool:
    """Return whether an effect of some parameters depends on loads."""
    return any(p.group in FAMILIES and FAMILIES[p.group].loaded for p in parameters)


def title_of(name: str) -> str:
    """Return an effect's name in words."""
    if name in FAMILIES:
        return FAMILIES[name].title
    return name.replace("_", " ")


def name_place(name: str, place: str) -> str:
    """Return an effect and where it is; of the base its title says it."""
    if place == BASE:
        return title_of(name)
    return f"{title_of(name)} in {'–'.join(joints_of(name, place))}"


def joints_of(name: str, place: str) -> Strings:
    """Return the joints of a place of an effect: two of a pair, else the place itself."""
    is_pair = name in FAMILIES and FAMILIES[name].pairs
    return split_pair(place) if is_pair else (place,)


def default_effects(robot: Robot, names: Iterable[str]) -> Strings:
    """Return the effects of a default model, at the places that the sidecar states.

    Effects that the sidecar places stay at those places; so does Coulomb friction with one level or
    with two. Effects without a place act everywhere, and effects that files state are added.

    Parameters
    ----------
    robot : Robot
    names : iterable of str
        The effects of the default model.
    """
    said: dict[str, list[str]] = {}
    for text in robot.said.effects:
        said.setdefault(text.partition("@")[0], []).append(text)
    out: list[str] = []
    used: set[str] = set()
    for name in names:
        refined = [s for s in said if s in find_effect(name).supersedes]
        if name in said or refined:
            source = name if name in said else refined[0]
            out += [name + text.removeprefix(source) for text in said[source]]
            used |= {name, source}
        else:
            stronger = [s for s in said if name in find_effect(s).supersedes]
            out += _elsewhere(robot, name, [text for s in stronger for text in said[s]])
    stated = [name for name, family in FAMILIES.items() if family.stated(robot)]
    chosen = {text.partition("@")[0] for text in out}
    out += [name for name in stated if name not in said and name not in chosen]
    return (*out, *(text for name, texts in said.items() if name not in used for text in texts))


def _elsewhere(robot: Robot, name: str, texts: Sequence[str]) -> list[str]:
    """Return an effect at the places where none of the effects that supersede it is."""
    if not texts:
        return [name]
    if any("@" not in text for text in texts):
        return []
    taken = [place for text in texts for place in split_places(text)[0]]
    places = find_family(name).places(robot)
    free = [p for p in places if not any(find_named(pattern, [p]) for pattern in taken)]
    return [f"{name}@{'+'.join(free)}"] if free else []


def split_places(text: str) -> tuple[list[str], float | tuple[float, ...] | None]:
    """Return the places and the shape of ``NAME@PLACE+PLACE:SHAPE``; names may have colons too."""
    written = text.partition("@")[2]
    places, colon, number = written.rpartition(":")
    try:
        numbers = tuple(map(float, number.split(",")))
    except ValueError:
        return written.split("+"), None
    if not colon:
        return written.split("+"), None
    return places.split("+"), numbers if len(numbers) > 1 else numbers[0]


def effect_laws() -> Mapping[str, Law]:
    """Return the laws by which effects can be hidden in a simulated robot, by name."""
    return {name: f.law for name, f in FAMILIES.items() if f.law is not None}


def load_plugin(path: str | Path) -> Strings:
    """Run a Python file that registers effects; return their names.

    Raises
    ------
    ModelError
        If there is no such file, it fails, or it registers nothing.
    """
    path = Path(path).resolve()
    name = f"identifiability_plugin_{path.stem}"
    known = set(FAMILIES)
    if not path.is_file():
        raise ModelError(f"The plugin '{path}' is not a file; give a Python file.")
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    except ModelError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever the user's file does
        at = traceback.extract_tb(error.__traceback__)[-1].lineno
        raise ModelError(
            f"The plugin '{path}' fails in line {getattr(error, 'lineno', at)} "
            f"({type(error).__name__}: {error}); mend it."
        ) from None
    added = tuple(n for n in FAMILIES if n not in known)
    if not added:
        raise ModelError(
            f"The plugin '{path}' registers no effect; put "
            "@identifiability.effects.declare(title) above its class."
        )
    return added
