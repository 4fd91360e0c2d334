"""What is feasible, and what a problem needs, as figures, tables for people and plain data."""
