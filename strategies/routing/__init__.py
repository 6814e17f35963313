"""Routing: which cells does a robot drive through?"""

from pkgutil import extend_path

__path__[:] = extend_path(__path__, __name__)  # as in `strategies`
