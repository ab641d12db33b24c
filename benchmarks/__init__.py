"""Benchmarks: kincompile and its peers side by side. `python -m benchmarks` measures and prints."""

import os

# Contenders work in one thread each, and NumPy's libraries ask when they are loaded.
for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
)
