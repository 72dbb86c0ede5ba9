"""Hostile robot files: MJCF."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

from hostile.case import NAMES, NUMBERS, Hostile, Make, encoded, hostile, listed, no_files, spoilt
from hostile.urdf import ENTITIES, declared, mjcf, repeated, urdf
from identifiability.robot.locate import locate_robot


def _including(
    name: str, file: str, make: Make | None = None, *, must_fail: bool = True
) -> Hostile:
    def both(path: Path) -> None:
        path.write_text(mjcf(head=f'<include file="{file}"/>'))
        if make is not None:
            make(path.with_name(file))

    return hostile("mjcf", f"includes {name}", both, suffix=".xml", must_fail=must_fail)


def _includes() -> Iterator[Hostile]:
    def text(content: str) -> Make:
        return lambda path: path.write_text(content) and None

    def chain(path: Path) -> None:
        for k in range(2000):
            path.with_name(f"{k}.xml").write_text(f'<mujoco><include file="{k + 1}.xml"/></mujoco>')
        path.write_text('<mujoco><include file="0.xml"/></mujoco>')
        path.with_name("2000.xml").write_text("<mujoco/>")

    def tree(path: Path) -> None:
        for k in range(9):
            inner = f'<include file="{k + 1}.xml"/>' * 10
            path.with_name(f"{k}.xml").write_text(f"<mujoco>{inner}</mujoco>")
        path.with_name("9.xml").write_text("<mujoco><option/></mujoco>")
        path.write_text('<mujoco><include file="0.xml"/></mujoco>')

    def empty_tree(path: Path) -> None:
        tree(path)
        path.with_name("9.xml").write_text("<mujoco/>")

    def many_large(path: Path) -> None:
        path.write_text("<mujoco>" + '<include file="big.xml"/>' * 200 + "</mujoco>")
        path.with_name("big.xml").write_text("<mujoco><!--" + "x" * 20_000_000 + "--></mujoco>")

    yield _including("/etc/passwd", "/etc/passwd")
    yield _including("/dev/zero", "/dev/zero")
    yield _including("/dev/stdin", "/dev/stdin")
    yield _including("a link to /dev/zero", "z.xml", lambda p: p.symlink_to("/dev/zero"))
    yield _including("a pipe", "pipe.xml", os.mkfifo)
    yield _including("a folder", ".")
    yield _including("the folder above", "..")
    yield _including("itself", "hostile.xml")
    yield _including("itself by another way", "../folder/./hostile.xml")
    yield _including("itself through a link", "l.xml", lambda p: p.symlink_to("hostile.xml"))
    yield _including("links in a ring", "l.xml", lambda p: p.symlink_to("l.xml"))
    yield _including(
        "one that includes it", "b.xml", text('<mujoco><include file="hostile.xml"/></mujoco>')
    )
    yield _including("nothing", "")
    yield _including("the network", "http://127.0.0.1:9/x.xml")
    yield _including("a name with a zero", "a&#0;b")
    yield _including("a name of 100,000 letters", "x" * 100_000)
    yield _including("a secret", "secret.txt")
    yield _including("a URDF", "b.xml", text(urdf()))
    yield _including("a billion laughs", "b.xml", text(
        declared("<mujoco><option timestep='&x;'/></mujoco>", ENTITIES["a billion laughs"], "mujoco")
    ))  # fmt: skip
    yield _including("escape sequences", "\x9b2J.xml")
    for name, make in (
        ("2,000 files in each other", chain),
        ("ten files, each ten times, nine deep", tree),
        ("nothing, a billion times", empty_tree),
        ("20 MB, 200 times", many_large),
    ):
        yield hostile("mjcf", f"includes {name}", make, suffix=".xml", must_fail=True)


def mjcfs() -> list[Hostile]:
    """Return hostile MJCF files."""

    def made(name: str, content: str | bytes | Make, *, must_fail: bool = False) -> Hostile:
        return hostile("mjcf", name, content, suffix=".xml", must_fail=must_fail)

    def many(piece: str, count: int, around: str = "{}") -> str:
        return around.format("".join(piece.format(k) for k in range(count)))

    site, joint = '<site name="s{}"/>', '<joint name="k{}"/>'
    geom = '<geom name="g{}" size="1"/>'
    body = '<body name="x{}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint/></body>'
    mesh = '<asset><mesh name="m" file="{}"/></asset>'
    of_mesh = '<body><joint/><geom type="mesh" mesh="m"/></body>'

    def with_mesh(content: bytes | None, file: str = "m.stl") -> Make:
        def make(path: Path) -> None:
            path.write_text(mjcf(mesh.format(file), body=of_mesh))
            if content is not None:
                path.with_name(file).write_bytes(content)

        return make

    def with_pipe(path: Path) -> None:
        path.write_text(mjcf(mesh.format("m.stl"), body=of_mesh))
        os.mkfifo(path.with_name("m.stl"))

    lying = b"\0" * 80 + (2**32 - 1).to_bytes(4, "little") + b"\0" * 500
    texts: dict[str, str | bytes | Make] = {
        "100,000 sites": mjcf(body=many(site, 100_000)),
        "19,000 sites": mjcf(body=many(site, 19_000)),
        "1,000 joints in a body": mjcf(body=many(joint, 1000, "<body><geom size='1'/>{}</body>")),
        "19,000 joints in a body": mjcf(body=many(joint, 19_000, "<body><geom size='1'/>{}</body>")),
        "19,000 geoms in a body": mjcf(body=many(geom, 19_000)),
        "199 bodies beside each other": mjcf(body=many(body, 198)),
        "19,000 bodies": mjcf(body=many(body, 19_000)),
        "a million bodies": repeated(
            b"<mujoco><worldbody>", b"<body/>", 1_000_000, b"</worldbody></mujoco>"
        ),
        "249 bodies in each other": "<mujoco><worldbody>" + "<body>" * 249 + "</body>" * 249
        + "</worldbody></mujoco>",
        "190 bodies in each other": "<mujoco><worldbody>"
        + '<body><joint/><geom size="1"/>' * 190 + "</body>" * 190 + "</worldbody></mujoco>",
        "100,000 bodies in each other": "<mujoco><worldbody>" + "<body>" * 100_000,
        "frames in each other": mjcf(body="<frame>" * 240 + "</frame>" * 240),
        "default classes in each other": mjcf("<default>" + '<default class="{}">' * 200
        + "</default>" * 200 + "</default>"),
        "replicate, a billion times": mjcf(body=f'<replicate count="1000000000">{body.format("")}</replicate>'),
        "replicate in replicate": mjcf(body='<replicate count="99">' * 8 + "<geom size='1'/>" + "</replicate>" * 8),
        "replicate, minus one times": mjcf(body='<replicate count="-1"><geom size="1"/></replicate>'),
        "replicate, 1e9 times": mjcf(body='<replicate count="1e9"><geom size="1"/></replicate>'),
        "replicate, 0x7fffffff times": mjcf(body='<replicate count="0x7fffffff"><geom size="1"/></replicate>'),
        "composite": mjcf(body='<composite type="grid" count="1000 1000 1000" spacing="1"/>'),
        "flexcomp": mjcf(body='<flexcomp name="f" type="grid" count="999 999 999" spacing="1 1 1"/>'),
        "attach of /etc/passwd": mjcf('<asset><model name="m" file="/etc/passwd"/></asset>'),
        "a plugin that is not there": mjcf(head='<extension><plugin plugin="x.y"><instance name="i"/></plugin></extension>'),
        "a plugin by path": mjcf(head='<extension><plugin plugin="/lib/x.so"/></extension>'),
        "a size of memory of an exabyte": mjcf(head='<size memory="1E"/>'),
        "a size of 2e9 user data": mjcf(head='<size nuserdata="2000000000"/>'),
        "a size of 2e9 user values a body": mjcf(head='<size nuser_body="2000000000"/>'),
        "a size of 2e9 key frames": mjcf(head='<size nkey="2000000000"/>'),
        "sizes of 2e9 contacts": mjcf(head='<size nconmax="2000000000" njmax="2000000000"/>'),
        "a size of minus one": mjcf(head='<size nuserdata="-2"/>'),
        "numeric of 2e9 values": mjcf('<custom><numeric name="n" size="2000000000"/></custom>'),
        "a texture of a million squared": mjcf(
            '<asset><texture name="t" type="2d" builtin="flat" width="1000000" height="1000000"/></asset>'
        ),
        "a height field of a million squared": mjcf(
            '<asset><hfield name="h" nrow="1000000" ncol="1000000" size="1 1 1 1"/></asset>',
            body='<body><joint/><geom type="hfield" hfield="h" mass="1"/></body>',
        ),
        "a texture of /dev/zero": mjcf('<asset><texture name="t" file="/dev/zero"/></asset>'),
        "a mesh of /dev/zero": with_mesh(None, "/dev/zero"),
        "a mesh of a pipe": with_pipe,
        "a mesh that is not there": with_mesh(None),
        "a mesh of the network": with_mesh(None, "http://127.0.0.1:9/m.stl"),
        "a mesh that says it has 4e9 triangles": with_mesh(lying),
        "a mesh of noise": with_mesh(os.urandom(50_000) if False else bytes(range(256)) * 200),
        "a mesh of text": with_mesh(b"solid x\n" + b"facet normal nan nan nan\n" * 10_000),
        "an OBJ without end": with_mesh(b"v 0 0 0\n" * 2_000_000 + b"f 1 2 3\n", "m.obj"),
        "an MSH that says it has 2e9 points": with_mesh(
            b"".join((2_000_000_000).to_bytes(4, "little") for _ in range(4)), "m.msh"
        ),
        "a mesh of points that are none": mjcf(
            '<asset><mesh name="m" vertex="nan 0 0 1 0 0 0 1 0 0 0 1"/></asset>', body=of_mesh
        ),
        "a mesh of one point": mjcf('<asset><mesh name="m" vertex="0 0 0"/></asset>', body=of_mesh),
        "a mesh of 300,000 points": mjcf(
            '<asset><mesh name="m" vertex="' + " ".join(f"{k % 97} {k % 89} {k % 83}" for k in range(300_000))
            + '"/></asset>', body=of_mesh,
        ),
        "a skin of /dev/zero": mjcf('<asset><skin name="s" file="/dev/zero"/></asset>'),
        "19,000 sensors": mjcf(many('<jointpos name="p{}" joint="j"/>', 19_000, "<sensor>{}</sensor>")),
        "19,000 motors": mjcf(many('<motor name="a{}" joint="j"/>', 19_000, "<actuator>{}</actuator>")),
        "19,000 equalities": mjcf(many('<joint name="e{}" joint1="j"/>', 19_000, "<equality>{}</equality>")),
        "1,000 loops": mjcf(
            many('<connect name="e{}" body1="b" body2="world" anchor="0 0 0"/>', 1000, "<equality>{}</equality>")
        ),
        "9,000 tendons": mjcf(
            many('<fixed name="t{}"><joint joint="j" coef="1"/></fixed>', 9000, "<tendon>{}</tendon>")
        ),
        "a tendon of 18,000 joints": mjcf(
            many('<joint joint="j" coef="{}"/>', 18_000, '<tendon><fixed name="t">{}</fixed></tendon>')
        ),
        "a tendon of 18,000 sites": mjcf(
            many('<site site="s0"/>', 18_000, '<tendon><spatial name="t">{}</spatial></tendon>'),
            body=site.format(0),
        ),
        "19,000 key frames": mjcf(many('<key name="k{}"/>', 19_000, "<keyframe>{}</keyframe>")),
        "a key frame of a million values": mjcf(f'<keyframe><key qpos="{"1 " * 1_000_000}"/></keyframe>'),
        "a polynomial of degree 1000": mjcf(
            f'<equality><joint joint1="j" polycoef="{"1 " * 1000}"/></equality>'
        ),
        "a rotation of zeros": mjcf(body='<body quat="0 0 0 0"><joint/><geom size="1"/></body>'),
        "inertia that no body has": mjcf().replace("1 1 1", "1 1 9"),
        "a scale of 1e300": mjcf().replace('mass="1"', 'mass="1e300"'),
        "a total mass of 1e308": mjcf(head='<compiler settotalmass="1e308"/>'),
        "a step of time that is none": mjcf(head='<option timestep="nan"/>'),
        "gravity of 1e308": mjcf(head='<option gravity="1e308 1e308 1e308"/>'),
        "Euler angles that are none": mjcf(head='<compiler eulerseq="abc"/>'),
        "ball joints": mjcf(body='<body><joint type="ball"/><geom size="1"/></body>'),
        "a free joint inside": mjcf(body="<body><freejoint/><geom size='1'/></body>"),
        "a joint of the world": "<mujoco><worldbody><joint/></worldbody></mujoco>",
        "a class that is not there": mjcf(body='<body childclass="\x9b2J"><geom size="1"/></body>'),
        "an element that is none": mjcf("<\u202ex/>".replace("\u202e", "é") * 10),
        "eleven million elements": repeated(b"<mujoco>", b"<a/>", 11_000_000, b"</mujoco>"),
        "100,000 elements in each other": "<mujoco>" + "<a>" * 100_000 + "</a>" * 100_000 + "</mujoco>",
        "user data of a million values": mjcf(body=f'<body user="{"1 " * 1_000_000}"/>'),
        "text of 40 MB": repeated(
            b'<mujoco><custom><text name="t" data="', b"xxxxxxxx", 5_000_000,
            b'"/></custom><worldbody/></mujoco>',
        ),
    }  # fmt: skip
    return listed(
        [made(name, text) for name, text in texts.items()],
        list(_includes()),
        [
            made(
                name,
                declared(mjcf(head="<option timestep='&x;'/>"), text, "mujoco"),
                must_fail="parameter" not in name,
            )
            for name, text in ENTITIES.items()
        ],
        [
            made(f"a mass of {number[:14]!r}", mjcf().replace('mass="1"', f'mass="{number}"'))
            for number in NUMBERS
        ],
        [
            made(f"a joint whose name is {name}", mjcf(name=quoteattr(text, {"\n": "&#10;"})))
            for name, text in NAMES.items()
        ],
        encoded("mjcf", "<?xml version='1.0' encoding='utf-8'?>" + mjcf(), ".xml"),
        no_files("mjcf", ".xml"),
        spoilt("mjcf", locate_robot("five-bar").read_bytes(), ".xml", 8),
    )
