"""Benchmarks: kincompile and its peers side by side. `python -m benchmarks` measures and prints."""
