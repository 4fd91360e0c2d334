"""Things in space as pictures of them: camera, axes box, glyphs of vehicles and gates, drawn by depth."""
