"""The fastest motion of the rigid body as a nonlinear program: collocation, boundary, bounds, gates."""
