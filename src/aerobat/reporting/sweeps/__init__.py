"""Sweeps as figures, tables for people and plain data."""
