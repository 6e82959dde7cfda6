"""Feather 2 and Arrow files as Parquet, batch by batch, each checked before it is used."""

from __future__ import annotations

from pathlib import Path

from tirelog.readers.extra.child import Answer, NoNumbers


def load() -> None:
    """Imports what reads it, and starts the threads that it would start later."""
    import pyarrow as pa
    import pyarrow.ipc as ipc
    import pyarrow.parquet

    pa.set_cpu_count(1)
    pa.set_io_thread_count(1)
    table = pa.table({"a": [0.0]})
    sink = pa.BufferOutputStream()
    with ipc.new_file(sink, table.schema) as made:
        made.write_table(table)
    with ipc.open_file(sink.getvalue()) as file:
        file.get_batch(0)


def convert(source: Path, target: Path, answer: Answer) -> None:
    """Writes the columns of numbers and of times to `target`.  NoNumbers: it has none."""
    import pyarrow as pa
    import pyarrow.ipc as ipc
    import pyarrow.parquet as pq

    alone = ipc.IpcReadOptions(use_threads=False)
    with source.open("rb") as stream, ipc.open_file(stream, options=alone) as file:
        kept = [
            k
            for k, field in enumerate(file.schema)
            if not (pa.types.is_nested(field.type) or pa.types.is_null(field.type))
        ]
        if not kept:
            raise NoNumbers("has no column of numbers")
        schema = pa.schema([file.schema.field(k) for k in kept])
        if len(kept) < len(file.schema):
            names = [field.name for k, field in enumerate(file.schema) if k not in kept]
            answer.passed_over.append(f"{', '.join(names[:5])} (lists and structures)")
        with pq.ParquetWriter(target, schema) as writer:
            for k in range(file.num_record_batches):
                batch = file.get_batch(k)
                batch.validate(full=True)
                writer.write_batch(batch.select(kept).replace_schema_metadata(None))
