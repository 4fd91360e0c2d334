"""Docstrings, help texts and headings begin with a verb or a noun, and no sentence is long."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from places import ROOT

LIBRARY = ROOT / "src" / "aerobat"
SOURCES = sorted(LIBRARY.rglob("*.py"))
ROOMS = sorted({path.relative_to(LIBRARY).parts[0] for path in SOURCES})
PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")])
PROSE = sorted({*PAGES, ROOT / "CHANGELOG.md", *(ROOT / "docs" / "how-to").glob("*.md")})
PARAGRAPH = re.compile(r"\n\s*\n|\n(?=\s*[-*|\d])")
BEGINS_BADLY = re.compile(r"(?:What|How|Whether|Which|Where|Its?|Itself|They|Them|Those|That|This|These)\b")
SENTENCE_END = re.compile(r"(?<=[.!?:;])\s+")
SECTIONS = re.compile(r"\n\s*(?:Args|Returns|Raises|Yields|Parameters)\b")
BLOCK = re.compile(r"```.*?```", re.DOTALL)
MOST_WORDS = 35
README_LINES = 120


def docstrings(source: str) -> Iterator[tuple[str, str]]:
    """Names and docstrings of a module, and of whatever public it holds; an option's help is one, too."""
    tree = ast.parse(source)
    yield "module", ast.get_docstring(tree) or ""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            yield node.name, ast.get_docstring(node) or ""
        if isinstance(node, ast.ClassDef):
            for before, after in zip(node.body, node.body[1:], strict=False):
                is_option = isinstance(before, ast.AnnAssign) and isinstance(after, ast.Expr)
                if is_option and isinstance(after.value, ast.Constant):
                    yield ast.unparse(before.target), str(after.value.value)


def faults(name: str, text: str) -> Iterator[str]:
    """Yield what is wrong with a text."""
    if BEGINS_BADLY.match(text.strip()):
        yield f"{name} begins with '{text.split()[0]}'"
    prose = " ".join(SECTIONS.split(text, maxsplit=1)[0].split())
    for sentence in SENTENCE_END.split(prose):
        if len(sentence.split()) > MOST_WORDS:
            yield f"{name} has a sentence of {len(sentence.split())} words: {sentence[:60]}"


@pytest.mark.parametrize("room", ROOMS)
def test_public_docstrings_and_help_texts_stand_alone(room: str) -> None:
    found = [
        (str(path), fault)
        for path in SOURCES
        if path.relative_to(LIBRARY).parts[0] == room
        for name, text in docstrings(path.read_text(encoding="utf-8"))
        for fault in faults(name, text)
    ]
    assert not found


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_headings_stand_alone(path: Path) -> None:
    headings = re.findall(r"^#+ (.*)$", BLOCK.sub("", path.read_text(encoding="utf-8")), re.MULTILINE)
    assert not [heading for heading in headings if BEGINS_BADLY.match(heading)]


@pytest.mark.parametrize("path", PROSE, ids=lambda path: path.name)
def test_sentences_of_pages_are_short(path: Path) -> None:
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    parts = [part.strip() for part in PARAGRAPH.split(text)]
    told = [part for part in parts if not part.startswith(("|", "#", "$$"))]
    assert not [fault for part in told for fault in faults(path.name, part) if "sentence" in fault]


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= README_LINES


def test_a_fault_is_found() -> None:
    assert list(faults("f", "What it is.")) == ["f begins with 'What'"]
    assert len(list(faults("f", " ".join(["word"] * 36)))) == 1
    assert not list(faults("f", "Return a whole. " + " ".join(["word"] * 34)))
