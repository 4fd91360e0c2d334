"""Chebyshev series on pieces of a trajectory: their errors, their extrema, and findings about limits."""
