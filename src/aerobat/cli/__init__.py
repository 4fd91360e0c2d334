"""The command line: plan | fly | sweep | check | compare | repeat | vehicles | problems."""

from aerobat.cli.entry import main

__all__ = ["main"]
