"""What each action does, by topic; the table of their keys is tui.widgets.bindings."""
