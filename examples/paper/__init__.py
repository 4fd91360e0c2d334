"""The paper's experiments, planned and flown anew, and its figures, drawn from them."""
