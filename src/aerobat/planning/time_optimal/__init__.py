"""The paper's reference [1] approach: the rigid body itself, collocated, at its rotors' limits."""
