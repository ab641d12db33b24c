"""A model as text: `files.write_model`, a floor above, knows the format and registers here."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

from kincompile.errors import InternalError


@singledispatch
def model_text(system: object, form: str) -> str:
    """Return a checked system as the text of a file; `form` is ``"toml"`` or ``"json"``."""
    raise InternalError(f"a {type(system).__name__} is to be written as {form} without `files`")


class TextViews:
    """The model as text, shared by `Mechanism` and `ConstraintSystem`."""

    def system(self) -> Any:
        """Return the checked system."""
        raise NotImplementedError

    def to_toml(self) -> str:
        """Return the model as TOML, as `kincompile.read` reads it.

        Raises
        ------
        ModelError
            If the model cannot be used as written, or has an expression that a file cannot hold.
        """
        return model_text(self.system(), "toml")

    def to_json(self) -> str:
        """Return the model as JSON; otherwise as `to_toml`."""
        return model_text(self.system(), "json")
