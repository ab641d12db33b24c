"""Emitted modules as typed objects, and the engines that solve with them."""
