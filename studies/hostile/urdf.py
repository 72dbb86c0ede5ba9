"""Hostile robot files: URDF, and SDF, which is not read."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

from hostile.case import NAMES, NUMBERS, Hostile, Make, encoded, hostile, listed, no_files, spoilt
from identifiability.robot.locate import locate_robot

_LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
_JOINT = '<joint name={} type="revolute"><parent link="{}"/><child link="{}"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>{}</joint>'
_BODY = (
    '<body name="{}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name={}/>{}</body>'
)

#: Declarations of entities that grow, or bring in what stands elsewhere; used as ``&x;``.
ENTITIES = {
    "a billion laughs": "".join(
        f'<!ENTITY {name} "{f"&{below};" * 10}">'
        for below, name in zip("abcdefghi", "bcdefghix", strict=True)
    ).replace("&a;", "lol"),
    "an entity of a million letters, many times": f'<!ENTITY y "{"y" * 1_000_000}"><!ENTITY x "{"&y;" * 500}">',
    "an entity of itself": '<!ENTITY x "&x;">',
    "an entity of /etc/passwd": '<!ENTITY x SYSTEM "file:///etc/passwd">',
    "an entity of a secret beside it": '<!ENTITY x SYSTEM "secret.txt">',
    "an entity of /dev/zero": '<!ENTITY x SYSTEM "/dev/zero">',
    "an entity of the network": '<!ENTITY x SYSTEM "http://127.0.0.1:9/x">',
    "a parameter entity of the network": '<!ENTITY % p SYSTEM "http://127.0.0.1:9/x"> %p;<!ENTITY x "1">',
}


def urdf(extra: str = "", name: str = '"j"', mass: str = "1", inside: str = "") -> str:
    """Return a URDF of one joint, with more in it."""
    link = _LINK.format("a").replace('value="1"', f'value="{mass}"')
    return f'<robot name="r">{_LINK.format("base")}{link}{_JOINT.format(name, "base", "a", inside)}{extra}</robot>'


def mjcf(extra: str = "", name: str = '"j"', body: str = "", head: str = "") -> str:
    """Return an MJCF of one joint, with more in it."""
    return f'<mujoco model="r">{head}<worldbody>{_BODY.format("b", name, body)}</worldbody>{extra}</mujoco>'


def declared(text: str, declarations: str, root: str) -> str:
    """Return markup with declarations of entities before it."""
    return f"<?xml version='1.0'?><!DOCTYPE {root} [{declarations}]>{text}"


def _chain(count: int) -> str:
    links = "".join(_LINK.format(k) for k in range(count + 1))
    joints = "".join(_JOINT.format(f'"j{k}"', k, k + 1, "") for k in range(count))
    return f'<robot name="r">{links}{joints}</robot>'


def repeated(before: bytes, piece: bytes, count: int, after: bytes) -> Make:
    """Return what writes a large file without holding it."""

    def make(path: Path) -> None:
        with path.open("wb") as file:
            file.write(before)
            block = piece * 1000
            for _ in range(count // 1000):
                file.write(block)
            file.write(after)

    return make


def urdfs() -> list[Hostile]:
    """Return hostile URDF files."""

    def made(name: str, content: str | bytes | Make, *, must_fail: bool = False) -> Hostile:
        return hostile("urdf", name, content, suffix=".urdf", must_fail=must_fail)

    ring = "".join(_LINK.format(k) for k in "abc") + "".join(
        _JOINT.format(f'"{p}{c}"', p, c, "") for p, c in ("ab", "bc", "ca")
    )
    named = "".join(_LINK.format(k) for k in ("base", "a"))
    mimics = "".join(
        _LINK.format(f"l{k}") + _JOINT.format(
            f'"m{k}"', "base", f"l{k}", f'<mimic joint="m{(k + 1) % 40}"/>'
        )
        for k in range(40)
    )  # fmt: skip
    texts: dict[str, str | bytes | Make] = {
        "joints in a ring": f'<robot name="r">{ring}</robot>',
        "a joint from a link to itself": urdf(_JOINT.format('"s"', "a", "a", "")),
        "a link with two parents": urdf(_LINK.format("c") + _JOINT.format('"s"', "c", "a", "")),
        "joints that follow each other in a ring": urdf(mimics),
        "a joint that follows itself": urdf(inside='<mimic joint="j"/>'),
        "a chain of 199 joints": _chain(199),
        "a chain of 100,000 joints": _chain(100_000),
        "a million joints": repeated(
            b'<robot name="r">', _JOINT.format('"j"', "a", "b", "").encode(), 1_000_000, b"</robot>"
        ),
        "a million joints without anything": repeated(
            b'<robot name="r"><link name="a"/>', b"<joint/>", 1_000_000, b"</robot>"
        ),
        "eleven million elements": repeated(
            b'<robot name="r">', b"<a/>", 11_000_000, b"</robot>"
        ),
        "45 MB of comment": repeated(b"<robot><!--", b"xxxxxxxxx", 5_000_000, b"--></robot>"),
        "45 MB of text": repeated(b"<robot>", b"xxxxxxxxx", 5_000_000, b"</robot>"),
        "a tag without end": repeated(b'<robot a="', b"xxxxxxxxx", 5_000_000, b""),
        "a million attributes": "<robot " + " ".join(f'a{k}="1"' for k in range(1_000_000)) + "/>",
        "a million spaces of names": "<robot "
        + " ".join(f'xmlns:a{k}="u{k}"' for k in range(200_000))
        + "/>",
        "100,000 elements in each other": "<robot>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>",
        "3 million elements without ends": b"<robot>" + b"<a>" * 3_000_000,
        "a link inside a link": urdf("<link name='x'><link name='y'/></link>"),
        "xinclude of /etc/passwd": urdf(
            '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="/etc/passwd" parse="text"/>'
        ),
        "xinclude of the network": urdf(
            '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="http://127.0.0.1:9/"/>'
        ),
        "a style sheet that runs": "<?xml-stylesheet href='http://127.0.0.1:9/x'?>" + urdf(),
        "a mesh of the network": urdf(
            '<link name="m"><visual><geometry><mesh filename="http://127.0.0.1:9/x.stl"/>'
            "</geometry></visual></link>"
        ),
        "a mesh of /dev/zero": urdf().replace(
            "</link>", '<collision><geometry><mesh filename="/dev/zero"/></geometry></collision></link>', 1
        ),
        "xacro that was not expanded": urdf('<xacro:include filename="$(env HOME)"/>').replace(
            "<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"', 1
        ),
        "a type of joint that is none": urdf().replace("revolute", "\x1b[31mrevolut"),
        "an axis of zeros": urdf().replace("0 0 1", "0 0 0"),
        "an axis without end": urdf().replace("0 0 1", "1 " * 1_000_000),
        "limits that are none": urdf().replace('lower="-1"', 'lower="nan"'),
        "limits the wrong way round": urdf().replace('upper="1"', 'upper="-5"'),
        "two links of one name": urdf(_LINK.format("a")),
        "two joints of one name": urdf(_LINK.format("c") + _JOINT.format('"j"', "a", "c", "")),
        "a link without a name": urdf("<link/>"),
        "a program": Path("/bin/sh").read_bytes()[:100_000],
        "a root that is another": "<html><body>404</body></html>",
    }  # fmt: skip
    unreadable = {
        k for k in texts if k.startswith(("joints in a ring", "eleven", "a million", "a tag"))
    }
    return listed(
        [made(name, text, must_fail=name in unreadable) for name, text in texts.items()],
        [
            made(name, declared(urdf(mass="&x;"), text, "robot"), must_fail=True)
            for name, text in ENTITIES.items()
        ],
        [made(f"a mass of {number[:14]!r}", urdf(mass=number)) for number in NUMBERS],
        [
            made(f"a joint whose name is {name}", urdf(name=quoteattr(text, {"\n": "&#10;"})))
            for name, text in NAMES.items()
        ],
        [
            made(
                "a link whose name is escape sequences",
                f'<robot name="r">{named}</robot>'.replace('"a"', '"a\x9b2J"'),
            )
        ],
        encoded("urdf", "<?xml version='1.0' encoding='utf-8'?>" + urdf(), ".urdf"),
        no_files("urdf", ".urdf"),
        spoilt("urdf", locate_robot("six-dof-arm").read_bytes(), ".urdf", 8),
    )


def sdfs() -> list[Hostile]:
    """Return SDF files, which are not read."""
    inner = (
        '<model name="m"><link name="a"/><include><uri>http://127.0.0.1:9/m</uri></include></model>'
    )
    texts = {
        "a model": f'<sdf version="1.9">{inner}</sdf>',
        "a model with a billion laughs": declared(
            '<sdf version="&x;"/>', ENTITIES["a billion laughs"], "sdf"
        ),
        "40 MB": repeated(b"<sdf>", b"<model/>", 5_000_000, b"</sdf>"),
    }
    return [
        hostile("sdf", name, text, suffix=".sdf", must_fail=True) for name, text in texts.items()
    ]
