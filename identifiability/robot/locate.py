"""Find a robot file and its sidecar, and read its XML with includes inserted.

A file that is too large, or includes itself, is refused at once.
"""

import codecs
import contextlib
import math
import xml.etree.ElementTree as ET
from collections import Counter
from importlib import resources
from io import BytesIO
from pathlib import Path
from xml.etree.ElementTree import Element

from identifiability.foundation.errors import RobotError, near_match
from identifiability.foundation.quoting import for_python, path_for_shell
from identifiability.foundation.rules import Tolerance

# Which sidecar belongs to a robot file: its own (arm.xml.toml), or one for its stem (arm.toml).
#
# Robot files that differ in their ending alone read one sidecar, unless one of them has its own.


#: Endings of robot files.
ENDINGS = (".urdf", ".xml", ".mjcf")


def own_sidecar(path: Path) -> Path:
    """Return the path of the sidecar that only one robot file reads."""
    return path.with_name(f"{path.name}.toml")


def find_sidecar(path: Path) -> Path | None:
    """Return the sidecar that a robot file is read with, if there is one."""
    places = (own_sidecar(path), path.with_suffix(".toml"))
    return next((place for place in places if place.is_file()), None)


def place_sidecar(path: Path, taken: Path | None) -> Path:
    """Return a path for a sidecar that no other robot file reads.

    Parameters
    ----------
    path : Path
        The robot file that is written.
    taken : Path, optional
        A sidecar that must not be replaced.
    """
    own = own_sidecar(path)
    shared = path.with_suffix(".toml")
    others = (path.with_suffix(ending) for ending in ENDINGS if ending != path.suffix.lower())
    read = any(p.is_file() and not own_sidecar(p).is_file() for p in others)
    mine = taken is None or taken.resolve() != shared.resolve()
    if mine and not read and not own.exists():
        return shared
    return own


# Where a robot file is: a path, or a shipped robot's name.


def shipped_folder() -> Path:
    """Return the folder of the shipped robots, in a wheel or in a checkout."""
    inside = Path(str(resources.files("identifiability"))) / "models"
    if inside.is_dir():
        return inside
    return inside.parent.parent / "models"


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    return sorted(p.parent.name for p in shipped_folder().glob("*/robot.[xu]*"))


def locate_robot(source: str | Path) -> Path:
    """Return the robot file of a path or a shipped name.

    Raises
    ------
    RobotError
    """
    path = Path(source)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise RobotError(f"'{source}' cannot be a robot file: {error.strerror}.") from None
    folder = shipped_folder() / str(source)
    for name in ("robot.xml", "robot.urdf"):
        if str(source) in shipped_robots() and (folder / name).is_file():
            return folder / name
    if (path / "case.toml").is_file():
        text = for_python(str(path))
        raise RobotError(
            f"{path} is the folder of a case; give the robot file in it, or Case.load({text})."
        )
    if path.is_dir():
        raise RobotError(f"{path} is a folder; give the robot file (MJCF or URDF) in it.")
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )


#: Letters of a name.
LONGEST_NAME = 500

#: No mass, moment, length or gravity in SI units is larger.
LARGEST: Tolerance = 1e15

#: No mass is smaller [kg], unless it is zero: centres of mass are quotients by it.
SMALLEST: Tolerance = 1e-12


# Parse the XML of a robot file within limits of size; a file without end is refused at once.


#: Bytes of meshes that weigh, and bytes of XML with all includes.
MOST_BYTES = 50_000_000
MOST_TEXT = 10_000_000
#: Bodies that move, when bodies on fixed joints are parts of those that carry them.
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
DEEPEST = 250

#: Attributes of one element. Readers of XML in C++ take the square of their number in time.
MOST_ATTRIBUTES = 100

#: Files that are included; one that includes itself is refused by their number.
MOST_INCLUDES = 100

#: The largest number in an attribute of an MJCF that asks for copies, rows, samples or vertices.
MOST_COPIES = {
    "count": MOST_ELEMENTS,
    "nrow": 4_000,
    "ncol": 4_000,
    "nsample": 10_000,
    "actdim": 1_000,
    "params": 1_000,
}

#: Parts of sections of an MJCF. MuJoCo takes the square of their number to take them out.
MOST_PARTS = {"asset": 1_000, "contact": 3_000, "sensor": 3_000, "custom": 3_000, "light": 3_000}

#: Elements of an MJCF that hold tables of numbers or lists of names, as long as the file allows.
_TABLES = {
    *("mesh", "hfield", "texture", "skin", "bone", "flex", "flexcomp", "key"),
    *("numeric", "text", "tuple", "config"),
}

#: Roots of robot files.
ROOTS = ("mujoco", "robot")


def check_files(path: Path, *files: Path, most: int = MOST_BYTES) -> None:
    """Refuse files of a robot that are too large together, or none, such as a pipe without end.

    Raises
    ------
    RobotError
    """
    odd = next((file for file in files if file.exists() and not file.is_file()), None)
    if odd is not None:
        raise RobotError(f"{odd} cannot be read: it is no file.")
    if sum(file.stat().st_size for file in files if file.exists()) > most:
        raise RobotError(
            f"{path} is larger than {most // 10**6} MB; robot files are read up to that."
        )


def read_bytes(path: Path) -> bytes:
    """Return the content of a robot file that begins with its XML declaration, if it has one.

    Blank lines and comments before the declaration move behind it. XML allows none there, and
    public files have them.
    """
    content = path.read_bytes()
    mark = content.startswith(codecs.BOM_UTF8) * len(codecs.BOM_UTF8)
    at = mark
    while True:
        at = len(content) - len(content[at:].lstrip())
        comment_end = content.find(b"-->", at)
        if not content.startswith(b"<!--", at) or comment_end < 0:
            break
        at = comment_end + len(b"-->")
    end = content.find(b"?>", at) + len(b"?>")
    if at == mark or not content.startswith(b"<?xml ", at) or end < at:
        return content
    return content[at:end] + content[mark:at] + content[end:]


class _Builder:
    """Builds the tree of a file, and refuses the file at the first exceeded limit.

    Text between elements is dropped, because it states nothing about a robot.

    Parameters
    ----------
    path : Path
        Path of the file, for messages.
    room : int
        Most elements of the file.
    """

    def __init__(self, path: Path, room: int) -> None:
        self.path = path
        self.room = room
        self.level = 0
        self.tree = ET.TreeBuilder()

    def doctype(self, *_declared: str | None) -> None:
        """Refuse a document type: its entities and attributes can multiply the size of a file."""
        raise RobotError(
            f"{self.path} declares a document type, <!DOCTYPE …>; no robot needs one: take it out, "
            "and write its entities where they are used."
        )

    def start(self, tag: str, attributes: dict[str, str]) -> Element:
        """Add an element."""
        self.room -= 1
        self.level += 1
        if self.room < 0:
            raise _too_large(self.path, f"more than {MOST_ELEMENTS} elements")
        if self.level > DEEPEST:
            raise _too_large(self.path, f"elements in each other, more than {DEEPEST} levels deep")
        if len(attributes) > MOST_ATTRIBUTES:
            raise _too_large(self.path, f"an element with more than {MOST_ATTRIBUTES} attributes")
        words = [tag, *attributes]
        words += [text for key, text in attributes.items() if key == "name" or tag not in _TABLES]
        if max(map(len, words)) > LONGEST_NAME:
            raise _too_large(self.path, f"a name or value of more than {LONGEST_NAME} letters")
        for key in MOST_COPIES.keys() & attributes.keys():
            self._check_copies(tag, key, attributes[key])
        return self.tree.start(tag, attributes)

    def _check_copies(self, tag: str, key: str, text: str) -> None:
        """Refuse a number of copies, rows, samples or vertices that would take too long."""
        if not all(abs(number) <= MOST_COPIES[key] for number in _read_numbers(text)):
            what = f"<{tag} {key}=…>, with a number larger than {MOST_COPIES[key]}"
            raise _too_large(self.path, what)

    def end(self, tag: str) -> Element:
        """End an element."""
        self.level -= 1
        return self.tree.end(tag)

    def close(self) -> Element:
        """Return the root element."""
        return self.tree.close()


def _read_numbers(text: str) -> list[float]:
    """Return the numbers of an attribute; skip other words, which MuJoCo refuses."""
    found = []
    for word in text.split():
        with contextlib.suppress(ValueError):
            found.append(float(word))
    return found


def parse_xml(path: Path, roots: tuple[str, ...], room: int = MOST_ELEMENTS) -> Element:
    """Return the root element of a file, which must be one of some.

    Parameters
    ----------
    path : Path
    roots : tuple of str
    room : int
        Elements that the file may have.

    Raises
    ------
    RobotError
    """
    try:
        check_files(path, path, most=MOST_TEXT)
        parser = ET.XMLParser(target=_Builder(path, room))
        root = ET.parse(BytesIO(read_bytes(path)), parser).getroot()
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        reason = getattr(error, "strerror", None) or error
        text = f"{path} cannot be read as MJCF or URDF: {reason}."
        if path.suffix.lower() == ".toml":
            text += " A sidecar is read with the robot file of its name: give that file."
        elif path.suffix.lower() not in ENDINGS:
            text += " Give the robot file first, then the logs."
        raise RobotError(text) from None
    if root.tag not in roots:
        raise RobotError(
            f"{path} is not an MJCF or URDF file: its root element is <{root.tag}>, expected "
            f"{' or '.join(f'<{r}>' for r in roots)}."
        )
    return root


def expand_includes(path: Path, root: Element, found: list[Path], room: int) -> int:
    """Insert the children of included files, and record these files.

    Parameters
    ----------
    path : Path
    root : Element
        Root element, which is changed in place.
    found : list of Path
        Included files; new ones are appended.
    room : int
        Number of elements that may still be included.

    Returns
    -------
    int
        Number of elements that may be included afterwards.

    Raises
    ------
    RobotError
    """
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag == "include"]:
            file = path.parent / child.get("file", "")
            found.append(file)
            if len(found) > MOST_INCLUDES:
                raise RobotError(
                    f"{path} includes more than {MOST_INCLUDES} files, or files include each other "
                    "in a ring; put them together."
                )
            check_files(path, path, *found, most=MOST_TEXT)
            inner = parse_xml(file, ("mujoco", "mujocoinclude"), room)
            elements = sum(1 for _ in inner.iter())
            room = expand_includes(path, inner, found, room - elements)
            at = list(parent).index(child)
            parent[at : at + 1] = list(inner)
    return room


def _too_large(path: Path, what: str) -> RobotError:
    return RobotError(f"{path} is too large: it has {what}; simplify it.")


def _check_size(path: Path, root: Element) -> None:
    """Refuse a file whose size, with its copies, would take minutes or all the memory.

    A body without a joint is part of its parent.
    """
    movable = {"joint", "freejoint"}
    attached = _count_attached(path, root)
    level = [(root, 1)]
    bodies = 0
    elements = 0
    for _ in range(DEEPEST):
        below = []
        for element, times in level:
            elements += times * (attached if element.tag == "attach" else _count_parts(element))
            if element.tag == "body":
                bodies += times * any(child.tag in movable for child in element)
            many = times * (_count_copies(element) if element.tag == "replicate" else 1)
            below += [(child, many) for child in element]
        level = below
    joints = root.findall("joint")
    bodies += sum(joint.get("type") != "fixed" for joint in joints)
    if level:
        raise _too_large(path, f"elements in each other, more than {DEEPEST} levels deep")
    if bodies > MOST_BODIES:
        raise RobotError(
            f"{path} has {bodies} bodies that move, with fixed joints merged; robots of up to "
            f"{MOST_BODIES} are read: leave bodies out, or fix joints that do not move."
        )
    if elements > MOST_ELEMENTS:
        raise _too_large(path, f"more than {MOST_ELEMENTS} elements, with copies counted")
    if root.tag == "mujoco":
        _check_parts(path, root)


def _check_parts(path: Path, root: Element) -> None:
    """Refuse an MJCF with too many parts to remove."""
    found = Counter({tag: sum(map(len, root.findall(tag))) for tag in MOST_PARTS})
    found["light"] = sum(1 for _ in root.iter("light"))
    for tag, most in MOST_PARTS.items():
        if found[tag] > most:
            raise _too_large(path, f"{found[tag]} parts of <{tag}>, and up to {most} are read")


def _count_attached(path: Path, root: Element) -> int:
    """Return the elements of the largest model that an MJCF attaches.

    MuJoCo reads these files by itself, so they are checked before it does.

    Raises
    ------
    RobotError
        If an attached file includes or attaches others.
    """
    files = [Path(model.get("file", "")) for model in root.iterfind("asset/model")]
    check_files(path, path, *files, most=MOST_TEXT)
    largest = 1
    for file in (file for file in files if file.is_file()):
        model = parse_xml(file, ("mujoco",))
        tags = Counter(element.tag for element in model.iter())
        if tags["include"] or tags["attach"]:
            raise RobotError(
                f"{path} attaches {file}, which includes or attaches other files; put them "
                "together."
            )
        _check_size(file, model)
        largest = max(largest, tags.total())
    return largest


def _count_copies(element: Element) -> int:
    """Return how many copies an element of an MJCF asks for."""
    numbers = _read_numbers(element.get("count", ""))
    return math.prod(max(1, round(number)) for number in numbers)


def _count_parts(element: Element) -> int:
    """Return the number of elements that an element expands to, apart from its children."""
    makes_parts = element.tag == "flexcomp" or (element.tag == "replicate" and not len(element))
    return _count_copies(element) if makes_parts else 1


def read_markup(path: Path) -> Element:
    """Return the root element of a robot file, with MJCF includes in their places.

    Raises
    ------
    RobotError
    """
    root, _ = read_included(path)
    if root.tag == "robot":
        _check_expanded(path, root)
    return root


def is_computed(text: str) -> bool:
    """Return whether xacro would compute a part of a text."""
    return "${" in text or "$(" in text


def _check_expanded(path: Path, root: Element) -> None:
    """Refuse a xacro file that is not expanded: the parts of its macros would be lost."""
    for element in root.iter():
        space, _, tag = element.tag.rpartition("}")
        named = [text for text in element.attrib.values() if is_computed(text)]
        if named or ("xacro" in space and tag not in ("property", "arg")):
            left = named[0] if named else f"<xacro:{tag}>"
            raise RobotError(
                f"{path} is a xacro file that was not expanded ('{left}' is left in it); run "
                f"xacro {path_for_shell(path.name)} > expanded.urdf and give expanded.urdf."
            )


def file_text(path: Path, root: Element) -> str:
    """Return an MJCF as one text, with its includes inserted."""
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except ValueError:  # another encoding
        text = ""
    if text and "<include" not in text:
        return text
    return ET.tostring(root, encoding="unicode")


def read_included(path: Path) -> tuple[Element, list[Path]]:
    """Return the root element of a robot file and the files that are included in it, in place.

    Raises
    ------
    RobotError
    """
    found: list[Path] = []
    root = parse_xml(path, ROOTS)
    if root.tag == "mujoco":
        elements = sum(1 for _ in root.iter())
        expand_includes(path, root, found, MOST_ELEMENTS - elements)
    _check_size(path, root)
    return root, found


def drop_repeated(root: Element) -> None:
    """Remove repeated elements of a URDF; readers take the first, and MuJoCo refuses them."""
    for element in (*root.findall("joint"), *root.iter("inertial")):
        seen = set()
        for child in list(element):
            if child.tag in seen:
                element.remove(child)
            seen.add(child.tag)
