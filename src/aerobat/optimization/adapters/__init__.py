"""General solvers behind the interface of the built-in one, with infeasibility confirmed."""
