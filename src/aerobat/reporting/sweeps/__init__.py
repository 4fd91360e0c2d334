"""Facts and figures of sweeps, and facts of a search for gains."""
