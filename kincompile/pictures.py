"""Pictures of models and motions in a notebook, which `view`, far above, knows how to draw."""

from functools import singledispatch


@singledispatch
def picture_html(shown: object) -> str:
    """Return a picture of a value as HTML; "" where `view` is not loaded or has none."""
    del shown
    return ""
