"""Dialogs over the app."""
