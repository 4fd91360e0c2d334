"""`python -m aerobat.cli` is `aerobat`."""

from aerobat.cli import main

main()
