"""A mechanism as a function from inputs to outputs, with its derivatives."""
