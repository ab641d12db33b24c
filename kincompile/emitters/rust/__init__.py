"""Rust, without a dependency."""
