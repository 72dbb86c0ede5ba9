"""Ways to spoil a good file: bytes at random, markup, documents, tables, bags."""

from __future__ import annotations

import copy
import io
import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pandas as pd
from hypothesis import strategies as st

Spoilt = st.SearchStrategy[bytes]

NUMBERS = [b"nan", b"-inf", b"1e999", b"-1e-320", b"0", b"-1", b"1e18", b"9" * 400, b"0x10", b"1_0"]
TABLE = [b",", b"\n", b"\r\n", b";", b'"', b" ", b"t", b".q", b"elbow.q", b"a,b", b"True", b"#"]
TOML = [b"[", b"]", b"{", b"}", b'"', b"=", b"\n", b"[[models]]", b'name = "a"', b"[limits]", b"."]
JSON = [b"[", b"]", b"{", b"}", b'"', b":", b",", b"null", b"true", b'"sin"', b"NaN", b"[" * 3000]
BAG = [b"\x89MCAP0\r\n", b"\0" * 8, b"position", b"sensor_msgs/msg/JointState"]
XML = [
    b"<", b">", b"/>", b'"', b"<!--", b"&lt;", b"0 0 0", b"robot", b"mujoco", b'name=""',
    b"<body>", b"</body>", b'<body name="b"><joint name="j"/></body>', b"<inertial/>", b"<link/>",
    b'<joint type="ball"/>', b'type="free"', b"<mimic/>", b'<default class="c"/>', b"<equality>",
    b'<connect body1="link1" anchor="0 0 0"/>', b'<joint joint1="elbow" joint2="shoulder"/>',
    b'<include file="x.xml"/>',
]  # fmt: skip

#: Attributes of XML that fit one place and not another.
VALUES = [
    "", "0", "nan", "1 2", "1 0 0", "-1 -1 -1", "a", "world", "base", "link_1", "left_distal",
    "left_elbow", "joint_2", "ball", "free", "slide", "continuous", "floating", "fixed", "1e300",
]  # fmt: skip

#: Values that a document or a table may hold where another is meant.
ODD: list[Any] = [
    None, True, "", "a", "nan", "left_elbow", "link1.mz", "elbow.Fv", "é\n\0", "x" * 5000, 0, -1,
    10**40, 0.5, -1e-320, 1e300, float("nan"), float("-inf"), [], [[]], [1, 2], ["a", "a"], {},
    {"a": {"b": 1}}, [[1.0] * 3] * 3, [0.0, 0.0, 0.0],
]  # fmt: skip

_NUMBER = st.integers(0, 10_000)


def spoil_bytes(good: bytes, tokens: list[bytes]) -> Spoilt:
    """Any bytes, or good ones after a few cuts, copies and insertions."""
    piece = st.one_of(st.sampled_from(tokens + NUMBERS), st.binary(max_size=4))
    place, length = st.integers(0, len(good)), st.integers(0, 60)
    edit = st.tuples(st.sampled_from(["insert", "cut", "copy", "replace"]), place, length, piece)

    def apply(edits: list[tuple[str, int, int, bytes]]) -> bytes:
        out = good
        for what, at, size, new in edits:
            taken = out[at : at + size]
            middle = {"insert": new + taken, "cut": b"", "copy": taken + taken, "replace": new}
            out = out[:at] + middle[what] + out[at + size :]
        return out

    edited = st.lists(edit, min_size=1, max_size=4).map(apply)
    return st.one_of(edited, edited, st.binary(max_size=200))


def spoil_xml(good: bytes) -> Spoilt:
    """XML with some elements gone, doubled or moved, and some attributes gone or changed."""
    whats = ["lose", "double", "move", "lose attribute", "change attribute", "swap attribute"]
    edit = st.tuples(st.sampled_from(whats), _NUMBER, _NUMBER, st.sampled_from(VALUES))

    def apply(edits: list[tuple[str, int, int, str]]) -> bytes:
        root = ET.fromstring(good)
        for what, at, other, value in edits:
            nodes = [(parent, child) for parent in root.iter() for child in parent]
            if not nodes:
                break
            (parent, element), (_, second) = nodes[at % len(nodes)], nodes[other % len(nodes)]
            names = sorted(element.keys()) or ["name"]
            name = names[other % len(names)]
            if what in ("lose", "move"):
                parent.remove(element)
            if what == "double" or (what == "move" and second not in element.iter()):
                (parent if what == "double" else second).append(copy.deepcopy(element))
            if what == "lose attribute":
                element.attrib.pop(name, None)
            elif what == "change attribute":
                element.set(name, value)
            elif what == "swap attribute":
                element.set(name, second.get(name, value))
        return ET.tostring(root)

    return st.lists(edit, min_size=1, max_size=4).map(apply)


def spoil_document(good: dict[str, Any], dump: Callable[[Any], str]) -> Spoilt:
    """A document with some values lost, replaced, renamed, or put in each other's place."""
    whats = ["lose", "replace", "replace", "rename", "swap", "wrap"]
    edit = st.tuples(st.sampled_from(whats), _NUMBER, _NUMBER, st.sampled_from(ODD))

    def apply(edits: list[tuple[str, int, int, Any]]) -> bytes:
        document = copy.deepcopy(good)
        for what, at, other, value in edits:
            slots = list(_slots(document))
            if not slots:
                break
            (table, key), (second, twin) = slots[at % len(slots)], slots[other % len(slots)]
            held = table[key]
            if what in ("lose", "rename"):
                del table[key]
            if what == "rename" and isinstance(table, dict):
                table[str(value)[:40] + str(key)] = held
            elif what == "replace":
                table[key] = copy.deepcopy(value)
            elif what == "swap":
                table[key] = copy.deepcopy(second[twin])
            elif what == "wrap":
                table[key] = [held] if other % 2 else {"a": held}
        return dump(document).encode("utf-8", "surrogatepass")

    return st.lists(edit, min_size=1, max_size=4).map(apply)


def _slots(value: Any) -> Any:
    """Yield (table or list, key) of everything inside a document."""
    keys = value if isinstance(value, dict) else range(len(value))
    for key in list(keys):
        yield value, key
        if isinstance(value[key], (dict, list)):
            yield from _slots(value[key])


def to_toml(value: Any) -> str:
    """Return a document as TOML, everything below the first level inline."""
    return "".join(f"{json.dumps(k)} = {_inline(v)}\n" for k, v in value.items())


def _inline(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return {"NaN": "nan", "-Infinity": "-inf", "null": '""'}.get(json.dumps(value)) or (
        json.dumps(value)
    )


def spoil_frames(good: pd.DataFrame) -> st.SearchStrategy[pd.DataFrame]:
    """A table with columns lost, doubled, renamed or of another type, rows moved, cells odd."""
    columns = st.sampled_from(list(good.columns))
    names = st.sampled_from([*good.columns, "", "t ", "T", ".q", "elbow", "wrist.q", "wrist.tau"])
    types = st.sampled_from(["object", "str", "bool", "datetime64[ns]", "category", "float16",
                             "int64", "complex128", "Float64", "bytes"])  # fmt: skip
    edit = st.one_of(
        st.tuples(st.just("cell"), columns, _NUMBER, st.sampled_from(ODD)),
        st.tuples(st.just("type"), columns, _NUMBER, types),
        st.tuples(st.just("name"), columns, _NUMBER, names),
        st.tuples(st.just("rows"), columns, _NUMBER, st.sampled_from(
            ["lose", "double", "turn", "none", "few", "shift", "index"])),
        st.tuples(st.just("column"), columns, _NUMBER, st.sampled_from(
            ["lose", "double", "scale", "constant", "copy", "turn"])),
    )  # fmt: skip

    def apply(edits: list[tuple[str, str, int, Any]]) -> pd.DataFrame:
        frame = good.copy()
        for what, column, at, value in edits:
            if column in frame.columns and list(frame.columns).count(column) == 1 and len(frame):
                with suppress(Exception):  # what pandas cannot do is left out
                    frame = _edit(frame, what, column, at, value)
        return frame

    return st.lists(edit, min_size=1, max_size=4).map(apply)


def _edit(frame: pd.DataFrame, what: str, column: str, at: int, value: Any) -> pd.DataFrame:
    row = at % len(frame)
    if what == "cell":
        cells = frame[column].astype(object)
        cells.iat[row] = value
        return frame.assign(**{column: cells})
    if what == "type":
        return frame.assign(**{column: frame[column].astype(value)})
    if what == "name":
        return frame.rename(columns={column: value})
    if what == "rows":
        kept = {
            "lose": [*range(row), *range(row + at % 7 + 1, len(frame))],
            "double": [*range(row + 1), *range(row, len(frame))], "none": [],
            "turn": range(len(frame))[::-1], "few": range(min(at % 25, len(frame))),
        }  # fmt: skip
        if value == "index":
            return frame.set_index(column)
        if value == "shift":
            return frame.assign(**{column: frame[column].shift(at % 5)})
        return frame.iloc[list(kept[value])]
    if value == "lose":
        return frame.drop(columns=column)
    if value == "double":
        return pd.concat([frame, frame[[column]]], axis=1)
    if value == "turn":
        return frame[frame.columns[::-1]]
    other = {"scale": frame[column] * 10.0 ** (at % 20 - 10), "constant": frame[column].iat[0],
             "copy": frame.iloc[:, at % frame.shape[1]]}[value]  # fmt: skip
    return frame.assign(**{column: other})


def spoil_csv(good: pd.DataFrame) -> Spoilt:
    """Spoilt tables as CSV of several dialects."""
    dialect = st.tuples(
        st.sampled_from([",", ",", ",", ";", "\t", " "]), st.sampled_from([".", ".", ","]),
        st.sampled_from(["utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"]),
        st.sampled_from(["\n", "\r\n", "\r"]), st.booleans(), st.sampled_from([None, "%.3g"]),
    )  # fmt: skip

    def write(frame: pd.DataFrame, way: tuple[Any, ...]) -> bytes:
        sep, decimal, encoding, end, index, digits = way
        text = frame.to_csv(
            sep=sep, decimal=decimal, lineterminator=end, index=index, float_format=digits
        )
        return text.encode(encoding, "replace")

    return st.builds(write, spoil_frames(good), dialect)


def spoil_parquet(good: pd.DataFrame) -> Spoilt:
    """Spoilt tables as Parquet; what Parquet cannot hold becomes text."""

    def write(frame: pd.DataFrame, packing: str) -> bytes:
        stream = io.BytesIO()
        frame = frame.set_axis([str(c) for c in frame.columns], axis=1)
        try:
            frame.to_parquet(stream, compression=packing)
        except Exception:  # noqa: BLE001 - mixed cells, repeated names …
            stream = io.BytesIO()
            cells = frame.to_numpy(object)
            texts = {f"{c} {k}" if c in frame.columns[:k] else c: [str(x) for x in cells[:, k]]
                     for k, c in enumerate(frame.columns)}  # fmt: skip
            pd.DataFrame(texts).to_parquet(stream, compression=packing)
        return stream.getvalue()

    return st.builds(write, spoil_frames(good), st.sampled_from(["snappy", "gzip", "zstd", "none"]))
