"""The built-in strategies, one folder per layer; they see the world only through its public view."""
