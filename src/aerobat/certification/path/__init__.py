"""Findings that need no attitude: speed, derivatives, conditions, and passages through gates."""
