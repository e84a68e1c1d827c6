"""Reads a Parquet table with three libraries and compares it with the results it was made from."""

import sys

import pandas
import polars
import pyarrow.parquet
from results import posed, read

path, folder = sys.argv[1:]
expected = [(result["image"], vehicle) for result in read(folder) for vehicle in posed(result)]
print(pyarrow.parquet.read_schema(path).names)
tables = [
    pyarrow.parquet.read_table(path).to_pylist(),
    pandas.read_parquet(path).to_dict("records"),
    polars.read_parquet(path).to_dicts(),
]
for rows in tables:
    assert len(rows) == len(expected), (len(rows), len(expected))
    for row, (image, vehicle) in zip(rows, expected):
        pose = vehicle["pose"]
        assert row["image"] == image and row["model"] == pose["model"]
        assert row["score"] == vehicle["score"]
        assert [row["x"], row["y"], row["z"]] == pose["translation"]
        assert abs(row["r02"] - pose["rotation"][0][2]) < 1e-12
        assert [row["width"], row["height"], row["length"]] == [pose["extent"][k] for k in ("width", "height", "length")]
        assert row["confidence"] == pose["dense"]["confidence"]
print(f"Parquet: {len(expected)} rows are as they should be, read by pyarrow, pandas and polars")
