"""Ways around obstacles: routes on a grid, on different sides, and the paths along them that begin refinement."""
