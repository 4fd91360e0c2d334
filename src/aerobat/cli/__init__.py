"""The command line: plan | fly | check | compare | repeat | vehicles | problems."""

from aerobat.cli.entry import main

__all__ = ["main"]
