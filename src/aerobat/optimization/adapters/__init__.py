"""Solvers of others behind the interface of ours, their answers confirmed."""
