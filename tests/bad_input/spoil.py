"""Ways to spoil a good file: bytes at random, markup, documents."""

import copy
import json
import xml.etree.ElementTree as ET

from hypothesis import strategies as st

Spoilt = st.SearchStrategy[bytes]

NUMBERS = [b"nan", b"-inf", b"1e999", b"-1e-320", b"0", b"-1", b"1e18", b"9" * 400, b"0x10", b"1_0"]
TABLE = [b",", b"\n", b"\r\n", b";", b'"', b" ", b"t", b".q", b"elbow.q", b"a,b", b"True", b"#"]
TOML = [b"[", b"]", b"{", b"}", b'"', b"=", b"\n", b"[[models]]", b'name = "a"', b"[limits]", b"."]
JSON = [b"[", b"]", b"{", b"}", b'"', b":", b",", b"null", b"true", b'"sin"', b"NaN", b"[" * 3000]
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

#: Values that a document may hold where another is meant.
ODD = [
    None, True, "", "a", "nan", "left_elbow", "link1.mz", "elbow.Fv", "é\n\0", "x" * 5000, 0, -1,
    10**40, 0.5, -1e-320, 1e300, float("nan"), float("-inf"), [], [[]], [1, 2], ["a", "a"], {},
    {"a": {"b": 1}}, [[1.0] * 3] * 3, [0.0, 0.0, 0.0],
]  # fmt: skip

_NUMBER = st.integers(0, 10_000)


def spoil_bytes(good, tokens):
    """Any bytes, or good ones after a few cuts, copies and insertions."""
    piece = st.one_of(st.sampled_from(tokens + NUMBERS), st.binary(max_size=4))
    place = st.integers(0, len(good))
    length = st.integers(0, 60)
    edit = st.tuples(st.sampled_from(["insert", "cut", "copy", "replace"]), place, length, piece)

    def apply(edits):
        out = good
        for what, at, size, new in edits:
            taken = out[at : at + size]
            middle = {"insert": new + taken, "cut": b"", "copy": taken + taken, "replace": new}
            out = out[:at] + middle[what] + out[at + size :]
        return out

    edited = st.lists(edit, min_size=1, max_size=4).map(apply)
    return st.one_of(edited, edited, st.binary(max_size=200))


def spoil_xml(good):
    """XML with some elements gone, doubled or moved, and some attributes gone or changed."""
    whats = ["lose", "double", "move", "lose attribute", "change attribute", "swap attribute"]
    edit = st.tuples(st.sampled_from(whats), _NUMBER, _NUMBER, st.sampled_from(VALUES))

    def apply(edits):
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


def spoil_document(good, dump):
    """A document with some values lost, replaced, renamed, or put in each other's place."""
    whats = ["lose", "replace", "replace", "rename", "swap", "wrap"]
    edit = st.tuples(st.sampled_from(whats), _NUMBER, _NUMBER, st.sampled_from(ODD))

    def apply(edits):
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


def _slots(value):
    """Yield (table or list, key) of everything inside a document."""
    keys = value if isinstance(value, dict) else range(len(value))
    for key in list(keys):
        yield value, key
        if isinstance(value[key], (dict, list)):
            yield from _slots(value[key])


def to_toml(value):
    """Return a document as TOML, everything below the first level inline."""
    return "".join(f"{json.dumps(k)} = {_inline(v)}\n" for k, v in value.items())


def _inline(value):
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {_inline(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return {"NaN": "nan", "-Infinity": "-inf", "null": '""'}.get(json.dumps(value)) or (
        json.dumps(value)
    )
