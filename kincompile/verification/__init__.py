"""Verification of an emitted module by independent oracles."""
