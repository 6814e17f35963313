"""A* over poses, its ties settled by a rule."""
