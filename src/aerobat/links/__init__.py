"""Live links to vehicles, each with a clock of its own: what they share, and MAVLink."""
