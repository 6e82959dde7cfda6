"""A test campaign in one command: every log, every table, resumable.

    manifest.toml --manifest--> Campaign (logs with setups and conditions, tables with options,
                                models)
        --folder------> the output folder: files by name, whole or not there; held by one run at a
                        time
        --plan------> one Task per log, with a key made of bytes, setup, options and version
        --ledger----> which tasks are done under that key (skipped) and which are not
        --runner----> processes that carry out `runner.make_tables`:
                      log -> table=NAME/log=NAME/part.parquet
        --summary---> summary.csv: every log, what was made, how long, quality counts, errors
        --models----> compare, diagnose, ladder over all logs that could be read, from the means
                      that the workers kept of each

Results are a hive-partitioned Parquet dataset. A part appears whole or not at all, and a task's
ledger entry is written after its parts: what a kill leaves is either done or done again, to the
same bytes (nothing in the parts depends on clock or order). One run at a time per output folder:
the lock is held by the kernel for the process.
"""
