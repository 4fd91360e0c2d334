"""Computations of every tick, written once in scalar components, whatever the numbers are."""
