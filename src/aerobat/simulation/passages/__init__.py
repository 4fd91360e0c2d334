"""Passages of flights through gates: where a gate's plane is crossed, what the body leaves of its opening."""

from aerobat.simulation.passages.passage import PASSAGE_DEPTH, PASSAGE_WINDOW, Passage, passages
from aerobat.simulation.passages.polyline import flown_passages

__all__ = ["PASSAGE_DEPTH", "PASSAGE_WINDOW", "Passage", "flown_passages", "passages"]
