"""Flights under realistic conditions: the random draws of each flight, and the components that apply them."""
