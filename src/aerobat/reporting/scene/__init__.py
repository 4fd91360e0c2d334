"""Pictures of scenes in space: camera, axes box, and glyphs of vehicles, gates and obstacles by depth."""
