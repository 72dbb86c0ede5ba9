"""Write tables of values as TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(document: Mapping[str, Any]) -> str:
    """Return a document of numbers, texts, lists and tables as the text of a TOML file.

    Example
    -------
    >>> print(toml_text({"axes": [{"name": "jaws"}], "actuated": ["a"], "home": {"a.1": 0.5}}))
    actuated = ["a"]
    <BLANKLINE>
    [[axes]]
    name = "jaws"
    <BLANKLINE>
    [home]
    "a.1" = 0.5
    <BLANKLINE>
    """
    lines, sections = [], []
    for key, value in document.items():
        if isinstance(value, Mapping):
            sections.append((f"[{_key(key)}]", value))
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
            sections += [(f"[[{_key(key)}]]", table) for table in value]
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    for head, table in sections:
        lines += ["", head, *(f"{_key(k)} = {_value(v)}" for k, v in table.items())]
    return "\n".join(lines).lstrip("\n") + "\n"


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _value(value: Any) -> str:
    """Return a value on one line; numbers, texts and words for true and false are those of JSON."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
