"""The file of words and the pages that use it hold the same names; texts use the field's words."""

import ast
import re
from pathlib import Path

import identifiability

PACKAGE = Path(identifiability.__file__).parent


#: Words that were ours, what the field says, and files in which they mean something else.
NOT_OURS = {
    r"rungs?|ways? down": ("model, reduction path", ()),
    r"swa(?:y|ys|yed)": ("prior sensitivity", ("json.md",)),
    r"leftovers?": ("residual", ()),
    r"oddit(?:y|ies)": ("data-quality check", ()),
    r"in its stead|stand-ins?": ("competing hypothesis", ()),
    r"twins?": ("converted file", ()),
    r"foretells?": ("predictive likelihood", ()),
    r"confused": ("correlated", ()),
    r"spent on": ("contributes", ()),
    r"decisive": ("influential", ()),
    r"doubted|goes on from": ("borderline, warm start", ()),
    r"no real robot has exactly": ("not physically consistent", ()),
}


#: Any of them.
ANY = re.compile(rf"\b(?:{'|'.join(NOT_OURS)})\b", re.IGNORECASE)


def texts():
    """Sentences of the package that are no docstrings, and pages: where, and what."""
    root = PACKAGE.parent
    for path in sorted(PACKAGE.rglob("*.py")):
        code = path.read_text(encoding="utf-8")
        tree = ast.parse(code if ANY.search(code) else "")  # most have none of them
        bare = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        for node in ast.walk(tree):
            text = node.value if isinstance(node, ast.Constant) else None
            if isinstance(text, str) and " " in text and id(node) not in bare:
                yield path, text
    pages = [*(root / "docs").rglob("*.md"), *PACKAGE.rglob("*.toml"), *PACKAGE.rglob("*.j2")]
    for path in (*pages, root / "README.md"):
        yield path, path.read_text(encoding="utf-8")


def test_sentences_and_pages_say_it_in_the_words_of_the_field():
    found = [
        f"{path.name}: '{match[0]}'; say: {better}"
        for path, text in texts()
        if ANY.search(text)
        for word, (better, allowed) in NOT_OURS.items()
        for match in re.finditer(rf"\b(?:{word})\b", text, re.IGNORECASE)
        if path.name not in allowed
    ]
    assert not found, found
