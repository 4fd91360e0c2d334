"""Control laws that come with Aerobat beside its own, one a file."""
