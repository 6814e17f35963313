"""The colours of everything but the map, made from the map's own."""

from __future__ import annotations

from textual.theme import Theme as TextualTheme

from tui.render import styles
from tui.render.styles import COLOURS, Theme


def themes() -> list[TextualTheme]:
    """One for dark and one for light terminals."""
    return [_theme("dark"), _theme("light")]


def _theme(theme: Theme) -> TextualTheme:
    def colour(row: int) -> str:
        shades = COLOURS[row].dark if theme == "dark" else COLOURS[row].light
        return f"#{shades.true:06x}"

    return TextualTheme(
        name=f"automaton-{theme}",
        dark=theme == "dark",
        primary=colour(styles.DESTINATION),
        secondary=colour(styles.ROBOT),
        accent=colour(styles.LOADED),
        warning=colour(styles.LOADED),
        error=colour(styles.FAULT),
        success=colour(styles.DONE),
        foreground=colour(styles.TEXT),
        background=colour(styles.VOID),
        surface=colour(styles.FLOOR),
        panel="#262626" if theme == "dark" else "#dadada",
        variables={
            "footer-background": colour(styles.VOID),
            "footer-key-foreground": colour(styles.LOADED),
            "footer-description-foreground": colour(styles.DIM),
            "border": colour(styles.WALL),
            "border-blurred": colour(styles.WALL),
        },
    )
