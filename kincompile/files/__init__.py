"""Model files: TOML, JSON, .adm and .acf, and Python."""
