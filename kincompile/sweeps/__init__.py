"""Sweeps: a mechanism at many sets of parameters, in chunks, on any executor, into a store."""
