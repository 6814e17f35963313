"""Which kernels a process compiles, rather than loads: the first lines of its program."""

LISTENING = """
import json, sys
from automaton.engine.jit.numba_parts import event
compiled = []
class Listener(event.Listener):
    def on_start(self, event):
        compiled.append(event.data["dispatcher"].py_func.__name__)
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
"""
