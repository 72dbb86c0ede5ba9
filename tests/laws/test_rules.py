"""Every number by which something is decided says what it is and why, or its place of use does."""

import ast
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import get_type_hints

import pytest

import identifiability

PACKAGE = Path(identifiability.__file__).parent
ROOT = Path(__file__).parents[2]
TABLES = sorted(PACKAGE.rglob("rules.py"))
ROOMS = [p.parent.relative_to(PACKAGE).as_posix() for p in TABLES if p.parent.name != "foundation"]

#: Where a number is from: a publication; a test's level; a derivation; cases that were tried; a
#: reason that its text gives; nowhere but a developer's judgement.
BASES = ("literature", "level", "derived", "calibrated", "reasoned", "by hand")

#: Numbers of a comparison that decide nothing by their size: bounds of shares, halves, doublings.
PLAIN = {0.0, 0.5, 1.0, 2.0}

#: As many of something as an algorithm cannot do without (a derivative needs three samples), or as
#: a sentence lists, are no rule.
FEW = 4

#: Where a decimal at the head of a file is no rule, and why.
ELSEWHERE = {
    "models/": "how a shipped robot was made, which is part of a wheel",
    "report/": "how a page is drawn",
    "cli/": "seconds between lines of progress",
    "foundation/engines.py": "seconds that processes wait for each other",
    "foundation/linalg.py": "tolerances that the whole package shares",
    "foundation/rounding.py": "how numbers are written, and the level of intervals",
}


def tables(room):
    module = import_module(f"identifiability.{room.replace('/', '.')}.rules")
    kinds = [t for t in vars(module).values() if isinstance(t, type)]
    return [t() for t in kinds if t.__module__ == module.__name__]


def rows_of(rules):
    """Return of every number its name, what it is said to be, and its basis."""
    kinds = get_type_hints(type(rules), include_extras=True)
    told = {name: [n for n in kinds[name].__metadata__ if isinstance(n, str)] for name in kinds}
    return [(x.name, *told[x.name][0].rpartition(", ")[::2]) for x in fields(rules)]


@pytest.mark.parametrize("rules", [t for room in ROOMS for t in tables(room)], ids=repr)
def test_every_number_of_a_table_has_a_basis_and_a_meaning(rules):
    for _, meaning, basis in rows_of(rules):
        assert basis in BASES or (ROOT / basis).is_file()
        assert len(meaning) > 7


def test_there_are_not_more():
    assert sum(len(rows_of(t)) for room in ROOMS for t in tables(room)) <= 125


def decimals(node):
    return [
        n.value
        for n in ast.walk(node)
        if isinstance(n, ast.Constant) and isinstance(n.value, float)
    ]


def is_number(node):
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(node, ast.Constant) and type(node.value) in (int, float)


def factors(node):
    """Return by what a comparison multiplies or divides: ``3 * x / 2``, ``x / 100``."""
    products = [n for n in ast.walk(node) if isinstance(getattr(n, "op", 0), ast.Mult | ast.Div)]
    sides = [side for n in products for side in (n.left, n.right) if is_number(side)]
    return [n.value for n in sides if isinstance(n, ast.Constant)]


def quotients(node):
    """Return whole numbers that are divided: ``1 / 3``."""
    over = [n for n in ast.walk(node) if isinstance(getattr(n, "op", 0), ast.Div)]
    return [n.right.value for n in over if is_number(n.left) and isinstance(n.right, ast.Constant)]


def more(node):
    """Return whether it is compared which is more; which of some kinds something is, is no rule."""
    return any(isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE) for op in node.ops)


def told(lines, tree, node):
    """Return whether a comment above the statement of a comparison says what its number means."""
    around = [s for s in ast.walk(tree) if isinstance(s, ast.stmt) and node in ast.walk(s)]
    first = max(s.lineno for s in around)
    return first > 1 and lines[first - 2].lstrip().startswith("#")


def loose(path):
    """Yield numbers that decide without a word: in comparisons, or at the head of a file."""
    text = path.read_text()
    tree = ast.parse(text)
    lines = text.splitlines()
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [x.value for x in (node.left, *node.comparators) if isinstance(x, ast.Constant)]
            whole = [x for x in sides if type(x) is int and x > FEW and more(node)]
            odd = [x for x in decimals(node) + factors(node) if x not in PLAIN and x > 1e-200]
            odd += [x for x in whole if x != 100 or "percent" not in ast.unparse(node)]  # is one
            if odd and not told(lines, tree, node):
                yield f"{path.name}:{node.lineno} compares with {odd}: use RULES, or say why above"
    for node in tree.body:
        if isinstance(node, ast.Assign) and decimals(node.value) + quotients(node.value):
            value = node.value
            if isinstance(value, ast.Call | ast.Dict | ast.ListComp | ast.DictComp | ast.Subscript):
                continue  # a table of data, such as units, a type, or what is computed
            yield f"{path.name}:{node.lineno} {ast.unparse(node)}"


def test_no_number_decides_outside_the_tables_without_a_reason():
    found = [
        line
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.name != "rules.py"
        for where in [path.relative_to(PACKAGE).as_posix()]
        if not where.startswith(tuple(ELSEWHERE))
        for line in loose(path)
    ]
    assert found == []
