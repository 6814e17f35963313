"""The dark and the light theme of Textual's widgets, in the colours of the map."""

from __future__ import annotations

from textual.theme import Theme as TextualTheme

from tui.render import styles
from tui.render.styles import COLOUR_TABLE, Theme


def themes() -> list[TextualTheme]:
    """The dark and the light theme."""
    return [_theme("dark"), _theme("light")]


def _theme(theme: Theme) -> TextualTheme:
    def colour(row: int) -> str:
        shades = COLOUR_TABLE[row].dark if theme == "dark" else COLOUR_TABLE[row].light
        return f"#{shades.true:06x}"

    return TextualTheme(
        name=f"automaton-{theme}",
        dark=theme == "dark",
        primary=colour(styles.COLOUR_DESTINATION),
        secondary=colour(styles.COLOUR_ROBOT),
        accent=colour(styles.COLOUR_LOADED),
        warning=colour(styles.COLOUR_LOADED),
        error=colour(styles.COLOUR_FAULT),
        success=colour(styles.COLOUR_DONE),
        foreground=colour(styles.COLOUR_TEXT),
        background=colour(styles.COLOUR_VOID),
        surface=colour(styles.COLOUR_FLOOR),
        panel="#262626" if theme == "dark" else "#dadada",
        variables={
            "footer-background": colour(styles.COLOUR_VOID),
            "footer-key-foreground": colour(styles.COLOUR_LOADED),
            "footer-description-foreground": colour(styles.COLOUR_DIM),
            "text-disabled": colour(styles.COLOUR_DIM),  # of placeholders
            "block-cursor-blurred-background": "#303030" if theme == "dark" else "#dadada",
            "border": colour(styles.COLOUR_WALL),
            "border-blurred": colour(styles.COLOUR_WALL),
        },
    )
