"""Tables of a run for pandas and spreadsheets: orders, lines, trips, events, states and more."""
