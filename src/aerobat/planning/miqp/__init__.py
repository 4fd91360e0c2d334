"""The paper's Section II: a mixed-integer QP over an integrator, stages put in intervals, a search on dt."""
