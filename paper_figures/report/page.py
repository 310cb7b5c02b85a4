"""The report as one HTML file: Markdown rendered, figures embedded."""

from __future__ import annotations

import base64
import os
import re
from html import unescape
from pathlib import Path

from markdown_it import MarkdownIt

from experiments.tracking.files import read_file
from experiments.tracking.names import inner_path
from paper_figures.report.markdown import anchor

_STYLE = """
body { max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a }
body { font: 16px/1.5 system-ui, sans-serif }
h1, h2, h3 { line-height: 1.2; margin-top: 2.2rem }
table { border-collapse: collapse; display: block; overflow-x: auto; margin: 1rem 0 }
table { font-size: 0.85rem }
th, td { border-bottom: 1px solid #ccc; padding: 0.25rem 0.6rem; vertical-align: top }
thead th { border-bottom: 2px solid #666 }
code { font-size: 0.9em; background: #f3f3f3; padding: 0 0.2em }
figure { margin: 1rem 0 }
figcaption { font-size: 0.9rem; color: #444 }
img { max-width: 100%; display: block }
"""
_PNG = b"\x89PNG\r\n\x1a\n"  # how such a file begins


def html(markdown: str, folder: Path) -> str:
    """Render a report.

    Args:
        markdown: its text.
        folder: what the paths of its figures are relative to, in the folder of results. No
            picture from elsewhere is embedded: words of a text may come from somebody's files.
    """
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(markdown)
    body = re.sub(r"<h2>(.*?)</h2>", _with_anchor, body)
    body = re.sub(
        r"<p>(<img [^>]+>)</p>\n<p><em>(Figure .*?)</em></p>",
        r"<figure>\n\1\n<figcaption>\2</figcaption>\n</figure>",
        body,
    )
    body = re.sub(r'<img src="([^"]+)"', lambda match: _embedded(match[1], folder), body)
    title = markdown.partition("\n")[0].lstrip("# ")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _with_anchor(heading: re.Match[str]) -> str:
    """A heading that links can name."""
    text = unescape(re.sub(r"<[^>]+>", "", heading[1]))
    return f'<h2 id="{anchor(text)}">{heading[1]}</h2>'


def _embedded(path: str, folder: Path) -> str:
    """The beginning of an image's tag, its file in it if that is a PNG of the results."""
    results = folder.parent
    try:
        relative = Path(os.path.relpath(os.path.join(folder, path), results))
        content = read_file(inner_path(results, *relative.parts))
    except (OSError, ValueError):
        content = b""
    if not content.startswith(_PNG):
        return '<img data-left-out="no picture of these results"'
    return f'<img src="data:image/png;base64,{base64.b64encode(content).decode()}"'
