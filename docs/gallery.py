"""The gallery: a card for each study with its picture and question, and a page for each with its source; made when the site is built."""

import ast
from pathlib import Path

DOCS = Path(__file__).parent
STUDIES = DOCS.parent / "studies"
HEAD = """# Gallery

Each study answers one question with flexlin beside something else: a paper, a closed form, another program. A card leads to the study's
source, which runs as it stands; {doc}`studies` lists all of them in a table, those without a picture too.

::::{container} gallery
"""
CARD = """:::{{figure}} {picture}
:target: gallery/{name}.html
:alt: {name}

[{name}](gallery/{name}.md): {question}
:::
"""
PAGE = """# {name}

{text}
{picture}
## Source

```{{literalinclude}} ../../studies/{name}.py
:language: python
```
"""


def describe_study(path: Path) -> tuple[str, str]:
    """The question of a study, and all of its docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or path.stem
    return " ".join(text.partition("\n\n")[0].split()), text


def write_gallery(folder: Path = DOCS) -> list[Path]:
    """Write gallery.md and gallery/NAME.md; pages that are as they were stay untouched, so that nothing is built twice."""
    pages = folder / "gallery"
    pages.mkdir(exist_ok=True)
    studies = sorted(STUDIES.glob("*.py"))
    cards, written = [], {}
    for path in studies:
        name, (question, text) = path.stem, describe_study(path)
        exists = (DOCS / "pictures" / f"{name}.png").exists()
        picture = f"pictures/{name}.png"
        if exists:
            cards.append(CARD.format(name=name, picture=picture, question=question))
        shown = f"\n```{{figure}} ../{picture}\n:alt: {name}\n```\n" if exists else ""
        written[pages / f"{name}.md"] = PAGE.format(name=name, text=quote_commands(text), picture=shown)
    hidden = "\n".join(["```{toctree}", ":hidden:", "", *(f"gallery/{path.stem}" for path in studies), "```", ""])
    written[folder / "gallery.md"] = HEAD + "".join(cards) + "::::\n\n" + hidden
    for stale in set(pages.glob("*.md")) - set(written):
        stale.unlink()
    for page, content in written.items():
        if not page.exists() or page.read_text(encoding="utf-8") != content:
            page.write_text(content, encoding="utf-8")
    return list(written)


def quote_commands(text: str) -> str:
    """Indented lines of a docstring as blocks, so that Markdown leaves them as they are."""
    lines, inside = [], False
    for line in text.splitlines():
        if line.startswith("    ") != inside and line:
            lines.append("```none" if not inside else "```")
            inside = not inside
        lines.append(line[4:] if inside else line)
    return "\n".join([*lines, "```"] if inside else lines)
