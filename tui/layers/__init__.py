"""The layers of the map that come with the program, registered in pyproject.toml as others are."""
