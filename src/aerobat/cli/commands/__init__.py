"""One file a command, with one function of its name, imported when it is asked for."""
