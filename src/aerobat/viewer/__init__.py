"""Plans and flights to look at: one description of a scene, and the page that replays it."""
