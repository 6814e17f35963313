"""Charging: when, where and how long does a robot charge?"""

from pkgutil import extend_path

__path__[:] = extend_path(__path__, __name__)  # as in `strategies`
