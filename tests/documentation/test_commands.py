"""Commands that pages show are understood by the command line: their names, options and values."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from cyclopts import MissingArgumentError

from aerobat.cli.app import app
from places import ROOT

PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])
PAGES = [page for page in PAGES if "generated" not in page.parts]  # by a build of the site
SHOWN = re.compile(
    r"^(?:\$ )?(?:[A-Z_]+=\S+ )*(?:pip install uv && )?(?:uvx? (?:run )?)?(aerobat .*)$", re.MULTILINE
)
BLOCK = re.compile(r"^```(?:bash|sh|console)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(?:uv run )?(aerobat [^`]+)`")
LEFT_OPEN = re.compile(r"\.\.\.|…|\[|\||>|\b[A-Z]{3,}\b")  # a placeholder, a choice, another program


def commands(page: Path, in_text: bool = True) -> Iterator[str]:
    """Yield the commands of a page that leave nothing open: those of its blocks, and of its text."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = "\n".join(BLOCK.findall(text))
    for command in [*SHOWN.findall(blocks), *(INLINE.findall(text) if in_text else ())]:
        words = shlex.split(command.partition(" #")[0].removesuffix(" &"))
        if len(words) > 1 and not any(map(LEFT_OPEN.search, words)):
            yield shlex.join(words[1:])


SHOWING = {page: sorted(set(commands(page))) for page in PAGES}


@pytest.mark.parametrize("page", [page for page in PAGES if SHOWING[page]], ids=lambda page: page.name)
def test_commands_of_pages_are_understood(page: Path) -> None:
    for command in SHOWING[page]:
        with suppress(MissingArgumentError):  # prose names a command without what it takes
            app.parse_args(shlex.split(command), exit_on_error=False, print_error=False)


def test_pages_show_commands_and_a_wrong_one_is_found() -> None:
    assert len(SHOWING[ROOT / "docs" / "commands.md"]) > 30
    with pytest.raises(Exception, match="no-such-option"):
        app.parse_args(["fly", "flip-roll", "--no-such-option"], exit_on_error=False, print_error=False)
