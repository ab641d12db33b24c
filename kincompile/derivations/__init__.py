"""The derivation of a mechanism's equations, shown."""
