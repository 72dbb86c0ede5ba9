"""Hostile documents: sidecars, DH tables, ladders and limits in TOML, results and motions in JSON."""

from __future__ import annotations

import json
from pathlib import Path

from hostile.case import NAMES, NUMBERS, Hostile, Make, encoded, hostile, listed, no_files, spoilt
from identifiability.robot.locate import locate_robot

_LADDER = '[[models]]\nname = "a"\neffects = ["rigid_body", "viscous_friction"]\n'
_LIMITS = "shoulder = {q = [-1, 1], v = 2, a = 10}\nelbow = {q = [-1, 1], v = 2, a = 10}\n"
_DH = """convention = "standard"
[[links]]
name = "upper"
joint = "shoulder"
a = 0.4
alpha = "pi/2"
mass = 1.0
[[links]]
name = "fore"
joint = "elbow"
a = 0.3
"""


def _quoted(text: str) -> str:
    """Return a string of TOML."""
    return json.dumps(text.encode("utf-8", "replace").decode(), ensure_ascii=True).replace(
        "\\u00", "\\u00"
    )


def _endless(key: str) -> dict[str, str | bytes]:
    """Return TOML that costs a parser much, whatever it is about."""
    return {
        "lists in each other": f"{key} = " + "[" * 100_000,
        "lists in each other that end": f"{key} = " + "[" * 5000 + "]" * 5000,
        "tables in each other": f"{key} = " + "{a = " * 5000 + "1" + "}" * 5000,
        "a key of 100,000 parts": ".".join(["a"] * 100_000) + " = 1",
        "60 parts of a key, 20,000 times": "\n".join(
            ".".join([f"a{k}", *["b"] * 60]) + " = 1" for k in range(20_000)
        ),
        "300,000 keys": "\n".join(f"a{k} = 1" for k in range(300_000)),
        "300,000 tables": "\n".join(f"[a{k}]" for k in range(300_000)),
        "a list of a million numbers": f"{key} = [" + "1," * 1_000_000 + "]",
        "a number of 5,000 digits": f"{key} = " + "9" * 5000,
        "a number of 3 million digits": f"{key} = " + "9" * 3_000_000,
        "a number of 3 million digits in base 16": f"{key} = 0x" + "f" * 3_000_000,
        "a fraction of 3 million digits": f"{key} = 0." + "9" * 3_000_000,
        "an exponent without end": f"{key} = 1e" + "9" * 1_000_000,
        "a string of 3.9 MB": f'{key} = "' + "x" * 3_900_000 + '"',
        "a string without end": f'{key} = """' + "x" * 3_000_000,
        "a comment of 3.9 MB": "#" * 3_900_000,
        "300 MB": b"",
        "underscores": f"{key} = 1" + "_1" * 1_000_000,
        "quotes without end": f"{key} = " + '"' * 1_000_000,
        "a date that is none": f"{key} = 2024-99-99T99:99:99Z",
        "infinities": f"{key} = [inf, -inf, nan]",
    }  # fmt: skip


def _large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(180_000_000)


def _documents(reader: str, good: str, key: str) -> list[Hostile]:
    texts: dict[str, str | bytes | Make] = {**_endless(key), "300 MB": _large}
    named = texts | {f"{key} is {number[:12]!r}": f"{key} = {number}" for number in NUMBERS}
    return listed(
        [hostile(reader, name, text, suffix=".toml") for name, text in named.items()],
        encoded(reader, good, ".toml"),
        no_files(reader, ".toml"),
        spoilt(reader, good.encode(), ".toml", 6),
    )


def sidecars() -> list[Hostile]:
    """Return hostile sidecars."""
    good = locate_robot("five-bar").with_suffix(".toml").read_text()
    loop = '[[loops]]\nname = "l{}"\nbody1 = "left_distal"\npoint1 = [0.45, 0.0, 0.0]\nbody2 = "right_distal"\npoint2 = [0.45, 0.0, 0.0]\n'
    texts = {
        "10,000 loops": "".join(loop.format(k) for k in range(10_000)),
        "100 loops": "".join(loop.format(k) for k in range(100)),
        "a polynomial of degree 100,000": '[[couplings]]\njoint = "left_elbow"\nof = "left_shoulder"\npolynomial = ['
        + "1.0," * 100_000 + "]",
        "a joint that follows itself": '[[couplings]]\njoint = "left_elbow"\nof = "left_elbow"',
        "joints that follow each other": '[[couplings]]\njoint = "left_elbow"\nof = "right_elbow"\n'
        '[[couplings]]\njoint = "right_elbow"\nof = "left_elbow"',
        "a pattern that takes for ever": "[nominal]\n" + '"' + "*a" * 30 + '*.Fv" = 1.0',
        "a rule that takes for ever": "[columns]\n'(l|le|lef|left|.)+(_|.)+$x' = 'left_shoulder'",
        "10,000 rules": "[columns]\n" + "\n".join(f"'a{k}' = 'b{k}'" for k in range(10_000)),
        "a table of 100,000 torques": '[[known_torque]]\nalong = "left_shoulder"\ntable = ['
        + ",".join(f"[{k},0.0]" for k in range(100_000)) + "]",
        "100 × 100 motors": f"[transmission]\nmotors = {json.dumps([f'm{k}' for k in range(100)])}\n"
        f"coupling = {json.dumps([[1.0] * 100] * 100)}",
        "50,000 axes": "\n".join(f'[[axes]]\nname = "x{k}"\njoints = {{left_shoulder = 1}}' for k in range(50_000)),
        "300 axes": "\n".join(f'[[axes]]\nname = "x{k}"\njoints = {{left_shoulder = 1}}' for k in range(300)),
        "2,000 effects": f"effects = {json.dumps([f'joint_stiffness@left_shoulder{k}' for k in range(2000)])}",
        "2,000 effects of one joint": f"effects = {json.dumps(['joint_stiffness@left_shoulder'] * 2000)}",
        "home at 1e308": "[home]\nleft_shoulder = 1e308",
        "masses of 1e308": '[nominal]\n"left_distal.m" = 1e308',
        "a gain of zero": "[torque]\ngain = 0",
        "a gain of 1e308": "[torque]\ngain = 1e308",
        "all joints locked": "locked = ['left_shoulder', 'left_elbow', 'right_shoulder', 'right_elbow']",
        "bounds the wrong way round": "[bounds]\ntotal_mass = [5, 1]",
    }  # fmt: skip
    return listed(
        _documents("sidecar", good, "inertia_parts"),
        [hostile("sidecar", name, text, suffix=".toml") for name, text in texts.items()],
        [
            hostile(
                "sidecar",
                f"a robot whose name is {name}",
                f"name = {_quoted(text)}",
                suffix=".toml",
            )
            for name, text in NAMES.items()
        ],
        [
            hostile(
                "sidecar",
                f"an axis whose name is {name}",
                f"[[axes]]\nname = {_quoted(text)}\njoints = {{left_shoulder = 1}}",
                suffix=".toml",
            )
            for name, text in NAMES.items()
        ],
    )


def tables() -> list[Hostile]:
    """Return hostile tables of Denavit and Hartenberg."""
    link = '[[links]]\nname = "l{}"\njoint = "j{}"\na = 0.1\nmass = 1\n'
    texts = {
        "150 links": "".join(link.format(k, k) for k in range(150)),
        "50,000 links": "".join(link.format(k, k) for k in range(50_000)),
        "a link that is its own parent": _DH + 'parent = "fore"\n',
        "an angle in words that takes for ever": _DH.replace("pi/2", "9" * 100_000 + "*"),
        "an equation that runs": _DH + "equals = \"__import__('os').system('touch canary')\"\n",
        "an equation without end": _DH + f'equals = "{"-shoulder" * 50_000}"\n',
        "an equation in brackets": _DH + f'equals = "{"(" * 50_000}"\n',
        "a length of 1e308": _DH + "d = 1e308\n",
        "a mass of -1": _DH + "mass = -1\n",
        "1,000 closures": _DH + '[[closures]]\nname = "c{}"\nlink1 = "upper"\nlink2 = "fore"\n' * 1000,
    }  # fmt: skip
    named = {
        f"a joint whose name is {name}": _DH.replace('"elbow"', _quoted(text))
        for name, text in NAMES.items()
    }
    return listed(
        _documents("dh", _DH, "links"),
        [hostile("dh", name, text, suffix=".toml") for name, text in (texts | named).items()],
    )


def ladders() -> list[Hostile]:
    """Return hostile ladders."""
    submodel = '[[models]]\nname = "m{}"\nfrom = "m{}"\nzero = ["elbow.Fv"]\n'
    first = _LADDER.replace('"a"', '"m0"')
    texts = {
        "30,000 models": first + "".join(submodel.format(k, k - 1) for k in range(1, 30_000)),
        "a model that comes from itself": '[[models]]\nname = "a"\nfrom = "a"',
        "models that come from each other": '[[models]]\nname = "a"\nfrom = "b"\n[[models]]\nname = "b"\nfrom = "a"',
        "5,000 effects": f"[[models]]\nname = 'a'\neffects = {json.dumps(['rigid_body'] * 5000)}",
        "an effect that is a program": "[[models]]\nname = 'a'\neffects = ['os.system', '__import__']",
        "50,000 zeros": _LADDER + f"zero = {json.dumps([f'elbow.{k}' for k in range(50_000)])}",
        "a value of 1e308": _LADDER + '[models.hold]\n"elbow.Fv" = 1e308',
        "a tie of itself": _LADDER + '[models.tie]\n"elbow.Fv" = ["elbow.Fv", "elbow.Fv"]',
    }
    named = {
        f"a model whose name is {name}": _LADDER.replace('"a"', _quoted(text))
        for name, text in NAMES.items()
    }
    return listed(
        _documents("ladder", _LADDER, "models"),
        [hostile("ladder", name, text, suffix=".toml") for name, text in (texts | named).items()],
    )


def limits() -> list[Hostile]:
    """Return hostile limits of motions."""
    texts = {
        "limits of 1e308": _LIMITS.replace("[-1, 1]", "[-1e308, 1e308]"),
        "limits the wrong way round": _LIMITS.replace("[-1, 1]", "[1, -1]"),
        "limits of no width": _LIMITS.replace("[-1, 1]", "[1, 1]"),
        "speed of 1e-300": _LIMITS.replace("v = 2", "v = 1e-300"),
        "10,000 boxes": _LIMITS + "".join(f"[workspace.b{k}]\nx = [0, 1]\n" for k in range(10_000)),
    }
    return listed(
        [hostile("limits", name, text, suffix=".toml") for name, text in texts.items()],
        no_files("limits", ".toml")[:3],
        spoilt("limits", _LIMITS.encode(), ".toml", 4),
    )


def _json_bombs(good: str) -> dict[str, str | bytes | Make]:
    def sparse(size: int) -> Make:
        def make(path: Path) -> None:
            with path.open("wb") as file:
                file.write(b'{"x": "')
                file.truncate(size)

        return make

    return {
        "lists in each other": "[" * 100_000,
        "lists in each other that end": "[" * 50_000 + "]" * 50_000,
        "objects in each other": '{"a":' * 100_000,
        "a number of 5,000 digits": '{"robot": ' + "9" * 5000 + "}",
        "a number of a million digits": '{"robot": ' + "9" * 1_000_000 + "}",
        "a fraction of a million digits": '{"robot": 0.' + "9" * 1_000_000 + "}",
        "an exponent without end": '{"robot": 1e' + "9" * 1000 + "}",
        "2 million keys": "{" + ",".join(f'"{k}":1' for k in range(2_000_000)) + "}",
        "50 MB of numbers": '{"robot": [' + "1," * 25_000_000 + "1]}",
        "50 MB of lists": '{"robot": [' + "[]," * 16_000_000 + "1]}",
        "180 MB of zeros": sparse(180_000_000),
        "a string of 50 MB": '{"robot": "' + "x" * 50_000_000 + '"}',
        "a key twice": good[:-1] + "," + good[1:],
        "halves of letters": '{"robot": {"name": "\\ud800"}}',
        "infinities": '{"robot": [Infinity, -Infinity, NaN]}',
        "null": "null",
        "a list": "[]",
        "a program": "__import__('os').system('touch canary')",
    }


def results(fit: Path) -> list[Hostile]:
    """Return hostile results, made of one of `analyze`."""
    good = fit.read_text()
    content = json.loads(good)
    out: list[Hostile] = []

    def changed(name: str, reader: str = "fit", **what: object) -> None:
        text = json.dumps(content | {"fit": content["fit"] | what})
        out.append(hostile("result", name, text, suffix=".json", kind=reader))

    names, size = content["fit"]["names"], len(content["fit"]["values"])
    changed("values of 1e308", values=[1e308] * size)
    changed("values that are none", values=[float("nan")] * size)
    changed("no values", values=[])
    changed("a million values", values=[1.0] * 1_000_000)
    changed("values that are texts", values=["1"] * size)
    changed("a covariance of another shape", covariance=[[1.0]] * size)
    changed("a covariance that none has", covariance=[[-1e300] * size] * size)
    changed("names in another order", names=names[::-1])
    for told, text in NAMES.items():
        changed(f"a parameter whose name is {told}", names=[text, *names[1:]])
    for told, text in NAMES.items():
        robot = content["robot"] | {"name": text}
        whole = json.dumps(content | {"robot": robot})
        out.append(
            hostile("result", f"a robot whose name is {told}", whole, suffix=".json", kind="values")
        )
    bombs = _json_bombs(good.strip())
    return listed(
        out,
        [hostile("result", name, text, suffix=".json", kind="fit") for name, text in bombs.items()],
        encoded("result", good, ".json", "values"),
        no_files("result", ".json", "fit"),
        spoilt("result", good.encode(), ".json", 8, "fit"),
    )


def trajectories() -> list[Hostile]:
    """Return hostile motions."""
    file = locate_robot("two-link").parent / "trajectories.json"
    good, content = file.read_text(), json.loads(file.read_text())
    bombs = _json_bombs(good.strip())
    few = ("lists in each other", "a number of 5,000 digits", "50 MB of numbers", "null", "a list")
    out = [
        hostile("trajectory", name, bombs[name], suffix=".json") for name in few
    ]  # fmt: skip
    for number in ("1e308", "NaN", "-Infinity", "1e-320", "0", "9" * 400):
        for key, value in content.items():
            if isinstance(value, (int, float)) or key == "duration":
                text = json.dumps(content | {key: 0}).replace(f'"{key}": 0', f'"{key}": {number}')
                out.append(hostile("trajectory", f"{key} of {number[:8]}", text, suffix=".json"))
    return listed(
        out, no_files("trajectory", ".json")[:3], spoilt("trajectory", good.encode(), ".json", 10)
    )
