"""Datasets of computed points: batches sent to worker processes, and their Parquet files."""
