"""The command line: plan | fly | check | compare | vehicles | problems."""

from aerobat.cli.entry import main

__all__ = ["main"]
