"""The one continuous optimizer: polynomials between knots, as fast as all limits allow, certified."""
