"""Betaflight as a vehicle's flight controller: its simulator target, its settings, its serial protocol."""
