"""The command `identifiability`, and the check that its package belongs to this distribution.

Another distribution also installs a package `identifiability`. Each overwrites files of the other,
so this module stands outside of the package. It imports nothing that takes time.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

#: The package, this distribution, and the line by which our ``__init__.py`` is known.
PACKAGE, DISTRIBUTION = "identifiability", "robot_identifiability"
MARK = b'__distribution__ = "robot-identifiability"'

#: Python files at the top of our package; all else there are folders.
OUR_FILES = ("__init__.py", "__main__.py")


def find_owners(site: Path) -> Iterator[str]:
    """Yield the names of other distributions in a site directory that own the package."""
    owned = f"{PACKAGE}/__init__.py,".encode()
    for entry in sorted(site.glob("*.dist-info")):
        name = entry.name.partition("-")[0]
        if name == DISTRIBUTION:
            continue
        with suppress(OSError):
            lines = (entry / "RECORD").read_bytes().splitlines()
            if any(line.startswith(owned) for line in lines):
                yield name


def find_conflict() -> tuple[str, bool]:
    """Return a sentence on another owner of the package, and whether ours is still complete.

    The sentence is empty if there is no other owner. To look is cheap: records of all
    distributions are read only if a file, or a name in the site directory, gives reason to.
    """
    spec = find_spec(PACKAGE)
    if spec is None or spec.origin is None:  # without __init__.py there is a folder at most
        lost = f"The package '{PACKAGE}' lacks its __init__.py, as after another distribution"
        return f"{lost} was uninstalled: install robot-identifiability again.", False
    init = Path(spec.origin)
    folder, site = init.parent, init.parents[1]
    ours = MARK in init.read_bytes()
    foreign = [file for file in folder.glob("*.py") if file.name not in OUR_FILES]
    suspicious = foreign or any(site.glob(f"{PACKAGE}-*"))
    if ours and not suspicious:
        return "", True
    owners = [*find_owners(site)]
    if ours and not owners:
        return "", True
    what = "also owns" if ours else "has replaced files of"
    other = f"The distribution '{owners[0]}'" if owners else "Another distribution"
    uninstall = f"pip uninstall {owners[0] if owners else PACKAGE}"
    return (
        f"{other} {what} the package '{PACKAGE}' in {site}: run '{uninstall}', then install "
        "robot-identifiability again."
    ), ours


def main() -> None:
    """Run the command line, unless the package was replaced."""
    sentence, ours = find_conflict()
    if sentence and sys.stderr is not None:
        sys.stderr.write(f"{'Note' if ours else 'Error'}: {sentence}\n")
    if not ours:
        raise SystemExit(2)
    from identifiability.__main__ import main as run  # noqa: PLC0415 - only if it is ours

    run()
