"""Colours as they are written, on the command line and in Python: a name, #rrggbb or numbers with commas."""

from __future__ import annotations

from clpeel.errors import InputError


def parse_color(text: str, alpha: bool = False) -> tuple[float, ...]:
    """`steelblue`, `#rrggbb` or `R,G,B` as three numbers 0..1; with `alpha`, also `#rrggbbaa` or `R,G,B,A` as four.

    Raises InputError, which leaves it to the caller to say of what the colour is.
    """
    wrong = f"expected R,G,B in 0..1, #rrggbb or a colour name, got '{text}'"
    try:
        if "," in text and "(" not in text:
            color = tuple(float(part) for part in text.split(","))
        else:
            from PIL import ImageColor

            color = tuple(value / 255 for value in ImageColor.getrgb(text))
    except ValueError:
        raise InputError(wrong + _hint(text)) from None
    if len(color) == 4 and not alpha:
        raise InputError(f"{wrong}, which has an alpha")
    if len(color) not in (3, 4) or not all(0 <= value <= 1 for value in color):
        raise InputError(wrong)
    return color


def _hint(text: str) -> str:
    """The name that was meant, perhaps."""
    import difflib

    from PIL import ImageColor

    close = difflib.get_close_matches(text.lower(), ImageColor.colormap, n=1)
    return f"; did you mean {close[0]}?" if close else ""
