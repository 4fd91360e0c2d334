"""The command line: plan | fly | sweep | check | compare | export | repeat | vehicles | problems."""

from aerobat.cli.entry import main

__all__ = ["main"]
