"""Print every ratio in one table, measured in one run: start-up, logs, reports, batches, the model, diagnoses, trials.

python benchmarks/all.py [--quick]
"""

from __future__ import annotations

import batch
import diagnose
import logs
import model
from measure import main

if __name__ == "__main__":
    main("Print every ratio in one table.", logs.rows, batch.rows, model.rows, diagnose.rows)
