"""Random floors as pictures, for property tests; they shrink to free floor."""

from __future__ import annotations

from hypothesis import strategies as st


def pictures(symbols: str, width: int, height: int) -> st.SearchStrategy[str]:
    """Pictures of that size. A symbol that is named n times is drawn n times as often."""
    # Not st.text: it draws every symbol of its alphabet equally often.
    size = width * height
    cells = st.binary(min_size=size, max_size=size)

    def drawn(data: bytes) -> str:
        text = "".join(symbols[byte % len(symbols)] for byte in data)
        return "\n".join(text[start : start + width] for start in range(0, size, width))

    return cells.map(drawn)
