"""Feasible problems and the requirements of a problem, as figures, tables for people and plain data."""
