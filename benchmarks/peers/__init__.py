"""Contenders of the whole analysis: each module builds one for a mechanism."""
