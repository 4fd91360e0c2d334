"""Pictures that move: a flight at one instant after the other, and the video that they make."""
