"""Ways around obstacles: routes on different sides of them, and the paths along them that are refined."""
