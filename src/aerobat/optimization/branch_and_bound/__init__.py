"""The built-in exact solver: best-first branch and bound over the slots of stages."""
