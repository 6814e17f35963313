"""From plain values to a world at tick 0; checks that need a floor are here."""
