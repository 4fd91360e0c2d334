"""`python -m aerobat` is `aerobat`."""

from aerobat.cli import main

main()
