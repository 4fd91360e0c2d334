"""Maps of feasibility and the requirements of a problem: their facts and figures."""
