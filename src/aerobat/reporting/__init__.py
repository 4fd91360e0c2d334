"""Figures, tables and reports, for people and machines."""
