"""`Entry`: a small robot file that has one feature, and what may become of it.

A text marks its feature as ``[[with]]`` or ``[[with||without]]``; the file without it is what the
feature is held against.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

_MARK = re.compile(r"\[\[(.*?)(?:\|\|(.*?))?\]\]", re.DOTALL)


@dataclass(frozen=True)
class Entry:
    """A robot file with one feature.

    Attributes
    ----------
    name : str
        The feature, after the element that it belongs to.
    text : str
        The file, with its feature marked.
    refusal : str
        What a sentence that refuses the file must contain (in any case); empty where the file
        must be read.
    unreadable : bool
        Whether nothing could be right but to refuse it: the oracle has no answer either.
    inert : bool
        Whether the feature leaves the dynamics as they are.
    sidecar : str
        TOML beside the file.
    files : mapping
        Other files beside it, by name.
    spread : float
        How far joints go from home [rad; slides a fifth of it in m].
    """

    name: str
    text: str
    refusal: str = ""
    unreadable: bool = False
    inert: bool = False
    sidecar: str = ""
    files: Mapping[str, str] = field(default_factory=dict)
    spread: float = 4.0

    @property
    def urdf(self) -> bool:
        """Whether it is a URDF."""
        return self.text.lstrip().startswith("<robot")

    @property
    def marked(self) -> bool:
        """Whether there is a file without the feature."""
        return _MARK.search(self.text) is not None

    def write(self, folder: Path, *, without: bool = False) -> Path:
        """Write the file, with or without its feature, and what lies beside it."""
        path = folder / ("robot.urdf" if self.urdf else "robot.xml")
        path.write_text(_MARK.sub(lambda m: m[2] or "" if without else m[1], self.text))
        for name, text in self.files.items():
            (folder / name).write_text(text)
        if self.sidecar:
            path.with_suffix(".toml").write_text(self.sidecar)
        return path
