"""Aerobat plans, flies and proves aggressive maneuvers for multirotors."""
