"""Quote texts for shell, Python, HTML, XML, TOML, SVG, patches and terminals.

Use these functions for every name that comes from a robot file, a sidecar, a log, a column, a path
or an option. Such a name may hold quotes, line ends and commands. Each target has one function;
the others of a target build on it.
"""

import json
import math
import re
import shlex
from collections.abc import Iterable, Mapping
from pathlib import PurePath
from pprint import pformat
from typing import Any
from unicodedata import category
from urllib.parse import quote
from xml.etree import ElementTree

from markupsafe import Markup, escape

#: Kinds of characters that cannot be seen: control, format, surrogate, line and paragraph ends.
UNSEEN = ("Cc", "Cf", "Cs", "Zl", "Zp")

#: Characters that XML 1.0 cannot hold, not even as references.
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")

#: Keys that TOML takes without quotes.
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

#: Characters that a TOML text cannot hold and JSON leaves as they are.
_NOT_TOML = re.compile("[\x7f\ud800-\udfff]")

#: Characters that mean something between the quotes of ``$'…'``, or in an interactive shell.
_ACTIVE = "'\\!"


def is_unseen(letter: str) -> bool:
    """Return whether a character cannot be seen on a terminal."""
    return category(letter) in UNSEEN


# Shell: lines to copy.


def for_shell(text: str, *, always: bool = False) -> str:
    r"""Return a text as one word of a shell, on one line.

    Bash, zsh and POSIX 2024 read ``$'…'``, which holds characters that cannot be seen as bytes.

    Parameters
    ----------
    text : str
    always : bool
        Whether a plain word gets quotes, too, as in a sentence that ends with it.

    Examples
    --------
    >>> print(for_shell("a b"), for_shell("run.csv"), for_shell("$(id)\n"))
    'a b' run.csv $'$(id)\x0a'
    """
    if not any(map(is_unseen, text)):
        word = shlex.quote(text)
        if always and word == text:
            return f"'{word}'"
        return word
    return f"$'{''.join(map(_shell_letter, text))}'"


def _shell_letter(letter: str) -> str:
    """Return a character as it is written between the quotes of ``$'…'``."""
    if letter in _ACTIVE or is_unseen(letter):
        # Half a letter is a byte of a file's name that is not UTF-8; others are no text at all.
        half = "\udc80" <= letter <= "\udcff"
        content = letter.encode("utf-8", "surrogateescape" if half else "surrogatepass")
        return "".join(f"\\x{byte:02x}" for byte in content)
    return letter


def path_for_shell(path: str | PurePath, *, always: bool = False) -> str:
    """Return a path as one word of a shell that is never taken for an option; see `for_shell`.

    Examples
    --------
    >>> print(path_for_shell("-rf.csv"), path_for_shell("my logs/1.csv"))
    ./-rf.csv 'my logs/1.csv'
    """
    text = str(path)
    return for_shell(f"./{text}" if text.startswith("-") else text, always=always)


def option_for_shell(option: str, value: str, *, always: bool = False) -> str:
    """Return an option with its value as words of a shell; see `for_shell`.

    Examples
    --------
    >>> print(option_for_shell("--body", "tool 2"), option_for_shell("--body", "-rf"))
    --body 'tool 2' --body=-rf
    """
    between = "=" if value.startswith("-") else " "
    return f"{option}{between}{for_shell(value, always=always)}"


# Terminal: sentences.


def for_terminal(text: str, keep: str = "") -> str:
    r"""Return text with escapes instead of invisible characters.

    Parameters
    ----------
    text : str
    keep : str
        Characters that stay, such as line ends.

    Examples
    --------
    >>> print(for_terminal("wrist\x1b[2J"))
    wrist\x1b[2J
    """
    letters = (
        letter.encode("unicode_escape").decode()
        if is_unseen(letter) and letter not in keep
        else letter
        for letter in text
    )
    return "".join(letters)


# Python: scripts and snippets.


def for_python(value: Any, width: int | None = None) -> str:
    r"""Return texts, numbers, and lists and tables of them as a Python expression.

    Parameters
    ----------
    value : str, float, bool, None, list, tuple or dict
    width : int, optional
        Longest line [characters]; without it the expression has one line.

    Examples
    --------
    >>> print(for_python(['a"b', "c\n"]))
    ['a"b', 'c\n']
    """
    if width is None:
        return repr(value)
    return pformat(value, width=width, compact=True, sort_dicts=False)


# HTML: pages.


def for_html(text: str) -> Markup:
    """Return a text for an element or a quoted attribute of a page.

    Templates use it for every value, since Jinja escapes by the same function.

    Examples
    --------
    >>> print(for_html('</script>"'))
    &lt;/script&gt;&#34;
    """
    # UTF-8 cannot hold lone surrogates: they are escapes.
    return escape(text.encode("utf-8", "backslashreplace").decode("utf-8"))


def for_link(path: str) -> str:
    """Return a relative path as the address of a link.

    Examples
    --------
    >>> for_link("robots/a b:c.html")
    'robots/a%20b%3Ac.html'
    """
    return quote(path, errors="surrogateescape")


# XML: robot files.


def fits_xml(text: str) -> bool:
    """Return whether XML can hold a text without changes."""
    return _NOT_XML.search(text) is None


def for_xml(element: ElementTree.Element) -> str:
    """Return the XML of an element; characters that XML cannot hold become the sign U+FFFD.

    Examples
    --------
    >>> for_xml(ElementTree.Element("joint", name='"/><x>'))
    '<joint name="&quot;/&gt;&lt;x&gt;" />'
    """
    return _NOT_XML.sub("\ufffd", ElementTree.tostring(element, encoding="unicode"))


def for_xml_comment(text: str) -> str:
    """Return a text for the inside of an XML comment, which it cannot end.

    Examples
    --------
    >>> for_xml_comment("a --> b-")
    ' a – > b- '
    """
    inside = _NOT_XML.sub("\ufffd", text).replace("--", "– ")
    return f" {inside} "


# TOML: sidecars and ladders.


def for_toml(value: Any) -> str:
    r"""Return a text, number, list or table as a TOML value on one line.

    Examples
    --------
    >>> print(for_toml({"a b": ["x\n", 1.5, True]}))
    {"a b" = ["x\n", 1.5, true]}
    """
    if isinstance(value, Mapping):
        pairs = (f"{toml_key(name)} = {for_toml(entry)}" for name, entry in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(for_toml, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    text = json.dumps(value, ensure_ascii=False)
    return _NOT_TOML.sub(_toml_letter, text)


def _toml_letter(found: re.Match[str]) -> str:
    return "\\u007f" if found[0] == "\x7f" else "\ufffd"


def toml_key(name: str) -> str:
    """Return a key of a TOML table, quoted if necessary.

    Examples
    --------
    >>> print(toml_key("elbow"), toml_key("a.b"))
    elbow "a.b"
    """
    if _BARE_KEY.fullmatch(name):
        return name
    return for_toml(name)


def toml_comment(text: str) -> str:
    """Return a text as one line of TOML comment."""
    return f"# {_NOT_TOML.sub(chr(0xFFFD), for_terminal(text))}"


# SVG: figures that Matplotlib draws.


def for_svg(name: str, most: int = 28) -> str:
    r"""Return a name as one line of text for a figure: shortened, and not read as mathematics.

    Parameters
    ----------
    name : str
    most : int
        Most letters to draw; the middle of a longer name is omitted.

    Examples
    --------
    >>> print(for_svg("cost $(id)\nx"))
    cost \$(id) x
    """
    line = "".join(" " if category(letter).startswith("C") else letter for letter in name)
    if len(line) > most:
        half = most // 2
        line = f"{line[:half]}…{line[half + 1 - most :]}"
    return line.replace("$", r"\$")


def svg_id(name: str) -> str:
    """Return a name as a part of an identifier in SVG, which Matplotlib does not escape."""
    return quote(name, safe="", errors="surrogatepass")


# Patches: unified differences of files.


def for_patch(path: str) -> str:
    r"""Return a path as the header of a unified difference holds it.

    Examples
    --------
    >>> print(for_patch("a/arm.xml"), for_patch("b/a\nb.xml"))
    a/arm.xml "b/a\012b.xml"
    """
    content = path.encode("utf-8", "surrogateescape")
    odd = b'"\\'
    # Control characters of ASCII end at the space.
    if not any(byte < 0x20 or byte in odd for byte in content):
        return path
    return f'"{"".join(_patch_byte(byte, odd) for byte in content)}"'


def _patch_byte(byte: int, odd: Iterable[int]) -> str:
    if byte in odd:
        return f"\\{chr(byte)}"
    # Printable characters of ASCII.
    if 0x20 <= byte < 0x7F:
        return chr(byte)
    return f"\\{byte:03o}"
