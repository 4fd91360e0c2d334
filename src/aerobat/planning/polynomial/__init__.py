"""The paper's Section V: polynomials through knots, in closed form or with the knots free."""
