"""Control laws that come with Aerobat besides its tracking controller, one a file."""
