"""Words that sources and documentation do not use, with a list of exceptions that may only shrink.

`forbidden_words.txt` says how often each word still stands in a file.
`python tests/project/test_words.py` writes the list again after files were moved or words replaced; it
refuses to let a word spread.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
LIST: Final = Path(__file__).parent / "forbidden_words.txt"
FOLDERS: Final = ("automaton", "strategies", "layouts", "tui")

# In prose: comments, docstrings, messages, documentation. Behind each expression: what to write instead.
PROSE: Final = {
    r"\b(nobody|somebody|everybody|anybody)\b": "no robot, a robot, all robots",
    r"\banew\b": "again",
    r"\b(for want of|reckon\w*)\b": "without; estimate",
    r"\b(tells?|told|obeys?|heeds?|bury|creeps?)\b": "print, show, say what; robots send and receive",
    r"\b(is|are|was|were) none\b": "is not one",
    r"(?<!there )(?<!There )\b(is|are|was) no (?!longer|more|part|use|room|need|way|reason)": "is not a",
    r"\bhardly meant\b": "probably a mistake",
    r"\bdrawn at random\b": "random",
    r"\bin the sequence of their coming\b": "in arrival order",
    r"\b[Ww]ithdraw(s|al|als|ing|n)?\b": "retreat",
    r"\b([Cc]ircular wait|circles? of (waiting )?robots)\b": "wait cycle",
    r"\b(stands?|stood|standing) in line\b": "queue",
    r"\bout of order\b": "down",
    r"\b(becomes?|became|becoming) known\b": "is released",
    r"\b[Ff]ores(ee\w*|aw)\b": "predict",
    r"\b([Ss]ets?|setting) down\b": "drop",
    r"(?<!parking )\b[Bb]ays?\b": "parking bay",
    r"\bfigures?\b(?! \d)": "metric, for a number",
}
# As names of variables: they say how a value was obtained, not what it is.
NAMES: Final = ("found", "given", "told", "made", "seen", "kept", "whole")


# The comments and strings of a module, as `tokenize` finds them in ten times as long.
SAID: Final = re.compile(
    r'#[^\n]*|"""(?:\\.|[^\\])*?"""|"(?:\\.|[^"\\\n])*"|' + r"'(?:\\.|[^'\\\n])*'", re.DOTALL
)


def prose_of(path: Path, text: str) -> str:
    """Return the comments and the strings with a blank of a module; all of another file."""
    if path.suffix != ".py":
        return text
    return "\n".join(said for said in SAID.findall(text) if said[0] == "#" or " " in said)


def names_of(path: Path, text: str) -> Iterator[str]:
    """Yield the names that a module assigns to, arguments included."""
    if path.suffix != ".py":
        return
    code = SAID.sub("", text)
    if not any(name in code for name in NAMES):
        return
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id
        elif isinstance(node, ast.arg):
            yield node.arg


def sources() -> list[Path]:
    """Return the files that are searched."""
    found = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*")]
    code = sorted(path for path in found if path.suffix in (".py", ".yaml"))
    # Generated pages have the words of the code.
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [*(page for page in pages if not page.read_text("utf-8").startswith("<!--")), *code]


def uses() -> Counter[tuple[str, str]]:
    """Count each forbidden word in each file: (file, word)."""
    counts: Counter[tuple[str, str]] = Counter()
    for path in sources():
        name, text = path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
        prose = prose_of(path, text)
        for expression in PROSE:
            counts[name, expression] += len(re.findall(expression, prose))
        for variable in names_of(path, text):
            if variable in NAMES:
                counts[name, variable] += 1
    return +counts


def allowed() -> Counter[tuple[str, str]]:
    """Read the list of exceptions."""
    counts: Counter[tuple[str, str]] = Counter()
    for line in LIST.read_text(encoding="utf-8").splitlines():
        number, name, word = line.split(" ", 2)
        counts[name, word] = int(number)
    return counts


def by_word(counts: Counter[tuple[str, str]]) -> Counter[str]:
    """Sum the counts of all files."""
    total: Counter[str] = Counter()
    for (_, word), number in counts.items():
        total[word] += number
    return total


def test_forbidden_words_do_not_spread() -> None:
    more = [
        f"{name}: {word} ({PROSE.get(word, 'name what the value is')})"
        for name, word in sorted(uses() - allowed())
    ]
    assert not more, "\n".join(more)


def write() -> None:
    """Write the list again; refuse if a word is more frequent than before."""
    counts = uses()
    if LIST.exists() and (spread := by_word(counts) - by_word(allowed())):
        sys.exit(f"more frequent than before: {dict(spread)}")
    lines = [f"{number} {name} {word}\n" for (name, word), number in sorted(counts.items())]
    LIST.write_text("".join(lines), encoding="utf-8")


if __name__ == "__main__":
    write()
