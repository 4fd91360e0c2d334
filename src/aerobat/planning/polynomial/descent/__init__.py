"""Polynomials whose knots are free: the program, its samples, and the descent from a start."""
