"""Planning around obstacles: routes on different sides of them, and refined paths along the routes."""
