"""The paper's Section II: a mixed-integer QP over an integrator chain, which assigns stages to intervals."""
