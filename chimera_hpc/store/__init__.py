"""The store of a sweep in Zarr v3 (schema, ledger, claims): write, read, check, extend, merge."""
