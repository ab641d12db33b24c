"""What the numbers depend on: processor, Python, NumPy, SymPy, and how busy the machine was."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import numpy as np
import sympy


def description() -> str:
    """Return the machine and the versions in one line."""
    return (
        f"{_processor()}, {os.cpu_count()} cores; {platform.system()}, "
        f"Python {platform.python_version()}, NumPy {np.__version__}, SymPy {sympy.__version__}"
    )


def load() -> str:
    """Return how many processes wanted to run in the last minute, where the system tells."""
    return f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "unknown"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
