"""The command line: plan | fly | check | compare | vehicles | problems."""

from aerobat.cli.app import main

__all__ = ["main"]
