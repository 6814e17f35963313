"""The terminal program (Textual): on top of everything, imported by nothing headless."""

from pkgutil import extend_path

# A folder `tui` beside a scenario adds modules to this package but hides none of ours.
__path__[:] = extend_path(__path__, __name__)
