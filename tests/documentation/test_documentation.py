"""The documentation runs: Python blocks, the first command and its output; its links lead somewhere."""

import ast
import importlib
import importlib.util
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import aerobat as ab
from aerobat.reporting.report import PAGE
from places import ROOT, TESTS

GENERATED = ROOT / "docs" / "generated"  # by a build of the site
PAGES = sorted(
    [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *(page for page in (ROOT / "docs").rglob("*.md") if GENERATED not in page.parents),
        *(ROOT / "src").rglob("*.md"),
    ]
)
SCRIPTS = sorted(
    path for folder in ("benchmarks", "examples", "mutation") for path in (ROOT / folder).glob("*.py")
)
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
SMALLER = {"10_000": "20"}  # a fleet that shows the same in less time


def blocks(page: Path, language: str) -> list[str]:
    """Code blocks of a page, each below as many empty lines as it has lines above it there."""
    text = page.read_text(encoding="utf-8")
    found = (match for match in BLOCK.finditer(text) if match[1] == language)
    return ["\n" * text.count("\n", 0, match.start(2)) + match[2] for match in found]


def run(arguments: list[str], folder: Path) -> str:
    """What a Python process prints that runs in a folder."""
    environment = {**os.environ, "COLUMNS": "120", "MPLBACKEND": "agg", "PYTHONUTF8": "1"}
    environment["PYTHONPATH"] = str(ROOT / "examples")  # which pages tell to copy
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def anchor(heading: str) -> str:
    """The name by which a link calls a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def without_numbers(text: str) -> list[str]:
    """Lines with each number replaced, however wide its column is."""
    return [" ".join(re.sub(r"-?\d+(\.\d+)?", "#", line).split()) for line in text.strip().splitlines()]


@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page, "python")], ids=lambda page: page.name
)
def test_python_blocks_are_python_and_name_what_there_is(page: Path) -> None:
    for block in blocks(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "ab":
                assert node.attr in ab.__all__, f"ab.{node.attr}"


@pytest.mark.docs
@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page, "python")], ids=lambda page: page.name
)
def test_python_blocks_run_as_they_stand(page: Path, tmp_path: Path) -> None:
    """Each in a process of its own; those of one page share a folder, for one may read another's file."""
    for block in blocks(page, "python"):
        for large, small in SMALLER.items():
            block = block.replace(large, small)
        script = tmp_path / page.with_suffix(".py").name  # lines numbered as in the page
        script.write_text(block, encoding="utf-8")
        run([str(script)], tmp_path)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "toml")], ids=lambda page: page.name)
def test_toml_blocks_are_toml(page: Path) -> None:
    for block in blocks(page, "toml"):
        assert tomllib.loads(block)


@pytest.mark.docs
def test_the_first_command_prints_what_the_readme_shows(tmp_path: Path) -> None:
    commands, printed = blocks(ROOT / "README.md", "")[:2]
    install, command = commands.strip().splitlines()[0].split(" && ")
    assert install == "pip install uv"
    words = command.split()
    assert words[:3] == ["uv", "run", "aerobat"]
    shown = without_numbers(printed)
    assert without_numbers(run(["-m", "aerobat", *words[3:]], tmp_path))[: len(shown)] == shown


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(BLOCK.sub("", page.read_text(encoding="utf-8"))):
        if "://" in link or link.startswith("generated/"):  # what the site's build makes, it checks
            continue
        path, _, heading = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), link
        if heading:
            headings = re.findall(r"^#+ (.*)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert heading in map(anchor, headings), link


def labels_of_reports() -> set[str]:
    """The labels of lines in the facts of plans, flights and runs, as their source gives them."""
    found = set()
    for module in ("report", "plans", "flights"):
        source = (ROOT / "src" / "aerobat" / "reporting" / f"{module}.py").read_text(encoding="utf-8")
        for call in (each for each in ast.walk(ast.parse(source)) if isinstance(each, ast.Call)):
            place = {"line": 0, "Fact": 2}.get(getattr(call.func, "id", ""), len(call.args))
            if place < len(call.args) and isinstance(call.args[place], ast.Constant):
                found.add(call.args[place].value)
    return found - {"", "plan", "findings", "flights"}  # a heading, and tables


def test_the_page_of_reports_explains_every_line_of_theirs() -> None:
    found = labels_of_reports()
    assert {"margin", "flyability", "rescue", "limited by", "position error", "conditions"} <= found
    rows = re.findall(r"^\| (.*?) \|", (ROOT / PAGE).read_text(encoding="utf-8"), re.MULTILINE)
    explained = {label for row in rows for label in re.findall(r"`([^`]+)`", row)}
    assert found <= explained


def test_tests_that_pages_name_as_evidence_are_there() -> None:
    named = {name for page in PAGES for name in re.findall(r"`(test_\w+)`", page.read_text(encoding="utf-8"))}
    written = "\n".join(path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py"))
    assert named
    assert not [name for name in named if f"def {name}(" not in written]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_scripts_import_names_that_there_are(script: Path) -> None:
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("aerobat"):
            module = importlib.import_module(str(node.module))
            for name in node.names:
                assert hasattr(module, name.name) or importlib.util.find_spec(f"{node.module}.{name.name}")
