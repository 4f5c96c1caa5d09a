"""README and the pages of docs/, without docs/lab, as tests read them: text, links, blocks of code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
DOCS = sorted(page for page in (ROOT / "docs").glob("**/*.md") if page.parent.name != "lab")


def text(*pages: Path) -> str:
    """The pages one after the other; README and all of docs/ if none is named."""
    return "\n".join(page.read_text(encoding="utf-8") for page in pages or (README, *DOCS))


def blocks(page: Path, name: str) -> list[str]:
    """The blocks of code that follow the comment <!-- ci: NAME --> on a page."""
    return re.findall(rf"^<!-- ci: {name} -->\n```\w+\n(.*?)^```$", text(page), re.MULTILINE | re.DOTALL)


def anchors(page: Path) -> set[str]:
    """The fragments by which a page's headings can be linked, as GitHub forms them."""
    headings = re.findall(r"^#+ (.*)$", text(page), re.MULTILINE)
    slugs = [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings]
    before = [slugs[:number].count(slug) for number, slug in enumerate(slugs)]
    return {f"{slug}-{count}" if count else slug for slug, count in zip(slugs, before, strict=True)}


def links(page: Path) -> list[str]:
    """Where the links of a page lead."""
    plain, html = r"\]\(([^)\s]+)(?:\s[^)]*)?\)", r"<(?:img|a|source)\b[^>]*?\b(?:src|href|srcset)=\"([^\"]+)\""
    return [*re.findall(plain, text(page)), *re.findall(html, text(page))]
