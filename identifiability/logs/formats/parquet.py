"""Check from its metadata how much memory the rows of a Parquet file take, before it is read."""

from pathlib import Path

from identifiability.logs.names import check_names

from .reader import check_unpacked

#: Bytes of a value in memory, and bytes that the values of any file may take.
VALUE, LEAST = 8, 256_000_000


def check_parquet(path: Path) -> list[str]:
    """Refuse a file whose values take far more memory than the file has bytes.

    Runs of one value take almost no bytes. Metadata state the number of values, including those of
    lists.

    Returns
    -------
    list of str
        Columns of text. They are read as a dictionary, because every row may hold a long text.

    Raises
    ------
    LogError
    """
    from pyarrow.parquet import ParquetFile  # noqa: PLC0415 - only who reads Parquet pays for it

    with ParquetFile(path, pre_buffer=False) as file:
        metadata = file.metadata
        schema = file.schema
        names = [str(schema.column(k).path) for k in range(len(schema))]
        check_names(str(path), names)
        values = stated = 0
        for k in range(metadata.num_row_groups):
            group = metadata.row_group(k)
            stated += group.total_byte_size
            values += sum(group.column(c).num_values for c in range(group.num_columns))
        check_unpacked(path, max(stated, VALUE * values), LEAST)
        kinds = [schema.column(k).physical_type for k in range(len(schema))]
        single = [schema.column(k).max_repetition_level == 0 for k in range(len(schema))]
        return [
            name
            for name, kind, alone in zip(names, kinds, single, strict=True)
            if kind == "BYTE_ARRAY" and alone and "." not in name
        ]
