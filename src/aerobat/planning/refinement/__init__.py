"""Trajectory refinement, the continuous optimizer: minimum-time polynomials between knots, certified."""
