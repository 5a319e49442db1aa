"""The command line: one short file a verb."""

import os

# Before numpy is imported. The rig's products are small: threads of BLAS wait for each other, on
# a busy machine for many times what they compute. Whoever sets the variable keeps it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
