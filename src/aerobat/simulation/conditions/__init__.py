"""Flights as they would really be flown: what each draws, and the components that bring it about."""
