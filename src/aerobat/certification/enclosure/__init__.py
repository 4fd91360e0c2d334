"""Chebyshev series on pieces of a trajectory: their error, their extrema, and what those say of limits."""
