"""The command line; its commands are listed in `app`."""

from aerobat.cli.entry import main as main
