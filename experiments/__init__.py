"""The experiment framework: run one point, sweep many, keep what finished, collate tables."""

import os

# Before numpy is imported, here and in every worker: with another number of BLAS threads the
# same code gives other last digits, and workers that start threads of their own are slower.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"
