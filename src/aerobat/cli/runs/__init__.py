"""The folder of a run: what is written to it, what repeats it, and the plans that are read from it."""
