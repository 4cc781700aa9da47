"""Colours in text, on the command line and in Python: a name, #rrggbb, or numbers with commas."""

from __future__ import annotations

from clpeel.errors import InputError


def parse_color(text: str, alpha: bool = False) -> tuple[float, ...]:
    """Return `steelblue`, `#rrggbb` or `R,G,B` as three numbers 0..1.

    alpha: also accept `#rrggbbaa` and `R,G,B,A`, which give four numbers. Raises InputError. Its text does not say what
    the colour is for, so the caller adds that.
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
    """Return a hint with the colour name that was probably meant, or no text."""
    import difflib

    from PIL import ImageColor

    close = difflib.get_close_matches(text.lower(), ImageColor.colormap, n=1)
    return f"; did you mean {close[0]}?" if close else ""
