"""The terminal program (Textual): on top of everything, imported by nothing headless."""
