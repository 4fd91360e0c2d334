"""The folder of a run: its files, its record for repetition, and the plans that are read from it."""
