"""Questions about many plans or flights, each answered by one function."""
