"""Hostile logs: sheets of Excel."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import pandas as pd

from hostile.case import Hostile, Make, hostile, listed, spoilt


def sheets(good: pd.DataFrame) -> list[Hostile]:
    """Return hostile sheets of Excel."""
    stream = io.BytesIO()
    good.head(60).to_excel(stream, index=False)
    whole = stream.getvalue()
    kept = {
        i.filename: zipfile.ZipFile(io.BytesIO(whole)).read(i)
        for i in zipfile.ZipFile(io.BytesIO(whole)).infolist()
    }
    sheet = "xl/worksheets/sheet1.xml"
    space = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'

    def packed(count: int = 0, piece: bytes = b"", end: bytes = b"", **parts: bytes) -> Make:
        def make(path: Path) -> None:
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                for name, part in (
                    kept
                    | {k.replace("__", "/").replace("_xml", ".xml"): v for k, v in parts.items()}
                ).items():
                    with archive.open(name, "w", force_zip64=True) as file:
                        file.write(part)
                        if name == sheet and count:
                            block = piece * 1000
                            for _ in range(count // 1000):
                                file.write(block)
                            file.write(end)

        return make

    row = b'<row><c t="inlineStr"><is><t>x</t></is></c></row>'
    start, close = f"<worksheet {space}><sheetData>".encode(), b"</sheetData></worksheet>"
    first = {"xl__worksheets__sheet1_xml": start}
    laughs = ('<!DOCTYPE x [<!ENTITY a "' + "lol" * 1000 + '">' + "".join(
        f'<!ENTITY {c} "{f"&{b};" * 10}">' for b, c in zip("abcdefg", "bcdefgh", strict=True)) + "]>")  # fmt: skip
    texts: dict[str, Make | bytes] = {
        "20 million rows": packed(20_000_000, row, close, **first),
        "a row of 20 million cells": packed(20_000_000, b"<c><v>1</v></c>", b"</row>" + close,
                                            xl__worksheets__sheet1_xml=start + b"<row>"),
        "2 GB of blanks": packed(20_000, b" " * 100_000, close, **first),
        "a cell of 500 MB": packed(5000, b"x" * 100_000, b"</t></is></c></row>" + close,
                                   xl__worksheets__sheet1_xml=start + b'<row><c t="inlineStr"><is><t>'),
        "a cell at XFD1048576": packed(xl__worksheets__sheet1_xml=start
            + b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>' + close),
        "a cell at row 999999999": packed(xl__worksheets__sheet1_xml=start
            + b'<row r="999999999"><c r="A999999999"><v>1</v></c></row>' + close),
        "a size that is a lie": packed(xl__worksheets__sheet1_xml=f'<worksheet {space}><dimension ref="A1:XFD1048576"/><sheetData>'.encode() + close),
        "a billion laughs": packed(xl__worksheets__sheet1_xml=laughs.encode() + start.replace(b"<sheetData>", b"<sheetData><row><c><v>&h;</v></c></row>") + close),
        "an entity of /etc/passwd": packed(xl__worksheets__sheet1_xml=b'<!DOCTYPE x [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
            + start + b'<row><c t="inlineStr"><is><t>&x;</t></is></c></row>' + close),
        "formulas": packed(xl__worksheets__sheet1_xml=start + b"<row><c><f>SYSTEM(\"touch canary\")</f><v>1</v></c></row>" * 40 + close),
        "elements in each other": packed(1_000_000, b"<a>", b"", **first),
        "styles of 300 MB": packed(xl__styles_xml=f"<styleSheet {space}><fonts>".encode() + b"<font/>" * 3_000_000 + b"</fonts></styleSheet>"),
        "5 million shared texts": packed(xl__sharedStrings_xml=f"<sst {space}>".encode() + b"<si><t>a</t></si>" * 5_000_000 + b"</sst>"),
        "a link to the network": packed(xl___rels__workbook_xml=b"x"),
        "no sheet": packed(xl__worksheets__sheet1_xml=b""),
        "a picture by name": b"\x89PNG\r\n\x1a\n" + b"\0" * 5000,
        "an archive of nothing": b"PK\x05\x06" + b"\0" * 18,
    }  # fmt: skip

    def names(path: Path) -> None:
        good.head(60).rename(columns={"elbow.q": "=1+1.q"}).to_excel(path, index=False)

    return listed(
        [hostile("xlsx", k, v, suffix=".xlsx", kind="log") for k, v in texts.items()],
        [hostile("xlsx", "a column that is a formula", names, suffix=".xlsx", kind="log")],
        spoilt("xlsx", whole, ".xlsx", 10, "log"),
    )
