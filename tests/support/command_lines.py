"""Command lines as tests run them: in this process, ending in an exit code, with or without pictures."""

from __future__ import annotations

import pytest

from aerobat import cli
from aerobat.reporting.page import png


def code(*arguments: object) -> int:
    """The exit code of a command line."""
    try:
        cli.main([str(each) for each in arguments])
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Exit code, standard output and standard error."""
    ended = code(*arguments)
    return ended, *capsys.readouterr()


def without_pictures(patch: pytest.MonkeyPatch) -> None:
    """Have reports of plans and flights come with an empty picture, for tests of something else."""
    patch.setattr("aerobat.cli.runs.folder.report_figure", lambda *_: None)
    patch.setattr("aerobat.cli.runs.folder.png", lambda figure: b"" if figure is None else png(figure))
