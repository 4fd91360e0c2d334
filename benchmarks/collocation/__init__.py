"""The paper's reference [1] approach: the rigid body itself, collocated: a yardstick for refined plans."""
