"""The limit of the body: the fastest periodic gait at a mean power, by direct collocation (ours)."""

import os

# One thread for CasADi's own OpenBLAS, which threadpoolctl does not know: last digits depend on how many share a sum.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
