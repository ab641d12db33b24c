"""From a program to files."""
