"""LaTeX between dollars as MathML, which browsers draw without a script or a connection."""

import html
import re

from latex2mathml import converter

# code is left alone, and so is what is no text at all
_OPAQUE = re.compile(r"(<(pre|code|script|style|svg|math)\b.*?</\2>|<[^>]*>)", re.DOTALL)
_DISPLAY, _INLINE = re.compile(r"\$\$(.+?)\$\$", re.DOTALL), re.compile(r"\$([^$\n][^$]*?)\$", re.DOTALL)
_PLACE = "\ue000{}\ue001"


def keep_math(markdown: str) -> tuple[str, list[str]]:
    """Markdown with placeholders for its formulas, so that an underscore in one is no emphasis; and their MathML."""
    made: list[str] = []

    def put(match: re.Match[str], display: str) -> str:
        made.append(converter.convert(match[1].strip(), display=display))
        return _PLACE.format(len(made) - 1)

    parts = re.split(r"(```.*?```|`[^`\n]*`)", markdown, flags=re.DOTALL)
    for index in range(0, len(parts), 2):
        parts[index] = _DISPLAY.sub(lambda m: put(m, "block"), parts[index])
        parts[index] = _INLINE.sub(lambda m: put(m, "inline"), parts[index])
    return "".join(parts), made


def put_math(page: str, made: list[str]) -> str:
    """The page with its formulas in their places."""
    return re.sub(_PLACE.format(r"(\d+)"), lambda match: made[int(match[1])], page)


def in_html(page: str) -> str:
    """A finished page whose text has formulas between dollars; those of code are left."""
    parts = _OPAQUE.split(page)
    # the pattern has two groups, so that a text is followed by what is opaque and by the name of its tag
    for index in range(0, len(parts), 3):
        if "$" in parts[index]:
            text = html.unescape(parts[index]) if "$" in parts[index] else parts[index]
            kept, made = keep_math(text)
            parts[index] = put_math(html.escape(kept, quote=False), made)
    for index in range(2, len(parts), 3):
        parts[index] = ""
    return "".join(part or "" for part in parts)
