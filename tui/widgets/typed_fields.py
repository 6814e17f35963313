"""Fields of text in which keys take effect in the order in which they are typed.

Textual 8.2 gives a printable character to the field at once, and a key that is bound, such as
backspace, to what it is bound to only after it has gone through the queues of all parents: characters
that come in the same read are entered before it, and it deletes the last of them. Here the field
carries out what is bound, in itself or around it, before it takes the next key.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual import events
from textual.screen import ModalScreen
from textual.widgets import Input, TextArea

if TYPE_CHECKING:
    from textual.dom import DOMNode as _Node
else:
    _Node = object


class KeysInOrder(_Node):
    """Comes before a widget of Textual among the bases of a field."""

    async def _on_key(self, event: events.Key) -> None:
        if event.is_printable:
            return
        for node in self.ancestors_with_self:
            for binding in node._bindings.key_to_bindings.get(event.key, ()):
                if await self.app.run_action(binding.action, node):
                    event.stop()
                    event.prevent_default()
                    return
            if isinstance(node, ModalScreen):
                return


class TypedInput(KeysInOrder, Input):
    """A line."""


class TypedText(KeysInOrder, TextArea):
    """Several lines."""
