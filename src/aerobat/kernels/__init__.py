"""Computations of every tick, written once in scalar components for all number types."""
