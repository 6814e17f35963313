"""The viewer's dialogs."""
