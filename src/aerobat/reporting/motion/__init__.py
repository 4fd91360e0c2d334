"""Animations: the picture of a flight at any instant, and videos of such pictures."""
