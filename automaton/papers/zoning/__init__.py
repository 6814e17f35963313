"""Keith & La: dynamic zones of a factory."""
