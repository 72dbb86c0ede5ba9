"""Read TOML and JSON documents and check them, one sentence about the first problem; write TOML."""

import json
import re
import stat
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, Field, ValidationError

from .errors import IdentifiabilityError, listing, near_match
from .findings import Finding
from .quoting import for_toml, toml_key

# Read TOML and JSON documents and check them: one sentence about the first problem.


Schema = TypeVar("Schema", bound=BaseModel)

_PARSERS = {"TOML": tomllib.loads, "JSON": json.loads}

#: Largest documents to read, in bytes: people write TOML, and results are JSON.
MOST_BYTES = {"TOML": 1_000_000, "JSON": 50_000_000}

#: Tables in tables that a dotted key may name; its parser takes the square of them in memory.
DEEPEST = 64

#: Keys by other names that drives and simulators have for them.
CALLED = {"kd": "kv", "damping": "kv", "stiffness": "kp", "effort_limit": "limit"}

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
# It begins where a part does: looked for in the middle, long words would take their square in time.
_DEEP_KEY = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{DEEPEST},}}")


def rising(span: tuple[float, float]) -> tuple[float, float]:
    """Check that a lower limit is below an upper one."""
    if not span[0] < span[1]:
        raise ValueError("the lower limit must be below the upper one")
    return span


#: A lower and an upper limit.
Span = Annotated[tuple[float, float], AfterValidator(rising)]


def key(said: str, default: Any = ..., example: Any = None, **limits: Any) -> Any:
    """Return a key of a schema with its description.

    Parameters
    ----------
    said : str
        A sentence, with the unit.
    default : any
        Without it the file must state the key.
    example : any
        A value as a file writes it, if the type does not make it clear.
    **limits
        Limits of the value, and an alias, for `pydantic.Field`.
    """
    examples = None if example is None else [example]
    return Field(default, description=said, examples=examples, **limits)


def read_document(
    path: str | Path,
    schema: type[Schema],
    form: Literal["TOML", "JSON"],
    what: str,
    error: type[IdentifiabilityError],
) -> Schema:
    """Read a document and return it as its schema.

    Parameters
    ----------
    path : path
    schema : pydantic model
        Schema of the document.
    form : {"TOML", "JSON"}
    what : str
        Kind of the document, such as ``ladder``.
    error : type
        Error to raise. Its sentence names the file, the key and the expected value.
    """

    def refused(part: str, **more: object) -> IdentifiabilityError:
        told = {"what": what, "form": form, **more}
        return error(Finding(f"document.{part}", path, **told))

    try:
        status = Path(path).stat()
        if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
            raise refused("special")  # a pipe would be waited for, a device has no end
        if status.st_size > MOST_BYTES[form]:
            raise refused("large", most=MOST_BYTES[form] / 1e6)
        text = Path(path).read_text(encoding="utf-8-sig")  # editors on Windows write the mark
    except FileNotFoundError:
        raise refused("none") from None
    except OSError as problem:
        raise refused("unread", why=problem.strerror) from None
    except ValueError as problem:  # not UTF-8, or a path that cannot be
        raise refused("foreign", why=str(problem)) from None
    if form == "TOML" and _DEEP_KEY.search(text):
        raise refused("deep", most=DEEPEST)
    try:
        content = _PARSERS[form](text)
    except (RecursionError, ValueError) as problem:
        raise refused("invalid", why=str(problem).rstrip(".")[:300]) from None
    try:
        return schema.model_validate(content)
    except ValidationError as problem:
        raise error(f"{path}: {first_problem(problem, schema)}") from None


def first_problem(error: ValidationError, schema: type[BaseModel]) -> str:
    """Return the first problem of a validation as the sentence ``'key': the expected value``."""
    problems = error.errors(include_url=False)
    first = _keys_of(problems[0]["loc"])
    within = (p for p in problems if _keys_of(p["loc"])[: len(first)] == first)
    problem = max(within, key=lambda p: len(_keys_of(p["loc"])))  # of several types the likeliest
    keys = _keys_of(problem["loc"])
    *above, last = keys or ("",)
    where = ".".join(map(str, (*above, last)))
    if problem["type"] == "extra_forbidden":
        known = _known_keys(schema, above)
        near = near_match(CALLED.get(str(last), str(last)), known)
        return f"'{where}' is not a key that is known here{near} The keys are {listing(known, 20)}."
    here = [p["msg"] for p in problems if _keys_of(p["loc"]) == keys]
    said = [text.removeprefix("Value error, ") for text in dict.fromkeys(here)]
    told = f"{', or '.join(text[0].lower() + text[1:] for text in said)}."
    return f"'{where}': {told}" if where else told  # without a key it is of the whole file


def _keys_of(place: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """Return the keys that lead to a place, without the alternative types of its value."""
    return tuple(part for part in place if not (isinstance(part, str) and _TYPE.fullmatch(part)))


#: Parts of an error's place that name one of several types of a value.
_TYPE = re.compile(
    r"constrained-\w+|(?:literal|dict|list|tuple|union|function-\w+)\[.*\]|float|int|str|bool"
)


def _known_keys(schema: type[BaseModel], place: Sequence[str | int]) -> list[str]:
    """Return the keys of the table at a place in a document."""
    for part in place:
        for name, field in schema.model_fields.items():
            if part in (name, field.alias) or name == "root":
                schema = _table_in(field.annotation) or schema
                break
    return [field.alias or name for name, field in schema.model_fields.items()]


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """Return the schema that a type such as ``dict[str, Entry]`` or ``Entry | None`` holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = map(_table_in, get_args(annotation))
    return next((table for table in found if table is not None), None)


# Write tables of values as TOML.


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
    lines = []
    sections = []
    for key, value in document.items():
        if isinstance(value, Mapping):
            sections.append((f"[{toml_key(key)}]", value))
        elif isinstance(value, list) and value and all(isinstance(v, Mapping) for v in value):
            sections += [(f"[[{toml_key(key)}]]", table) for table in value]
        else:
            lines.append(f"{toml_key(key)} = {for_toml(value)}")
    for head, table in sections:
        lines += ["", head, *(f"{toml_key(k)} = {for_toml(v)}" for k, v in table.items())]
    return "\n".join(lines).lstrip("\n") + "\n"
