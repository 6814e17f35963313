"""The built-in layers of the map, registered in pyproject.toml like any other layer."""
